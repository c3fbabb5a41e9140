// Figures. gnuplot draws them, and no other file knows it but for the drawing commands that it hands over.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace unhand::apps {

/// Rows of numbers or quoted text. gnuplot's `index` counts the blocks of a figure from 0.
struct DataBlock {
  std::string title;                      ///< a comment in the file
  std::vector<std::string> columns;       ///< names and units, a comment in the file
  std::vector<std::vector<double>> rows;  ///< finite
  std::vector<std::string> labels;        ///< empty, or one text per row: its last column
};

struct Figure {
  std::string name;              ///< stem of its files, as file_stem() gives it
  double width{17}, height{11};  ///< [cm]; text is 9 points at this size
  std::vector<DataBlock> data;
  std::string script;  ///< plot commands; the data file is the variable DATA
};

/// The text with everything replaced by '_' but letters, digits and "._-" of ASCII: what is safe in the name
/// of a file, in gnuplot and in a link.
std::string file_stem(const std::string& text);

/// Writes NAME.png and NAME.pdf, and beside them NAME.gp and NAME.dat from which `gnuplot NAME.gp` draws them
/// again; `about`, of what data and whether they are synthetic, is a comment in these. Throws Unanswered if
/// there is no gnuplot or it complains.
void draw(const Figure& figure, const std::filesystem::path& directory, const std::string& about);

/// Throws Unanswered, naming the package, where gnuplot is missing.
void require_gnuplot();

/// One model's look, the same in every figure: they differ in colour, in lightness and in marker.
struct Style {
  int marker{};        ///< gnuplot's point type
  std::string colour;  ///< "#rrggbb"
  int dash{};          ///< gnuplot's dash type
};
Style style_of(const std::string& model);

/// A panel of a multiplot: its edges [cm from the figure's lower left corner].
struct Panel {
  double left{}, right{}, bottom{}, top{};
};
std::string place(const Figure& figure, const Panel& panel);

/// The key of a multiplot, in a strip along the figure's lower edge. To be drawn last.
struct KeyEntry {
  std::string style;  ///< "with points pointtype 7 ..."
  std::string title;
};
constexpr double key_row = 0.5;  ///< [cm]
std::string key_strip(const Figure& figure, const std::vector<KeyEntry>& entries, int columns);
inline double key_height(std::size_t entries, int columns) {
  return key_row * static_cast<double>((static_cast<int>(entries) + columns - 1) / columns);
}

/// A round distance, so that there are three to seven tics beyond 0, up to `high`.
double tic_step(double high);

/// How an axis of values that are not negative shows them.
enum class Scale { linear, logarithmic };

/// Logarithmic where every panel's values, at least one, are positive, and those of one span more than a
/// factor of 20: panels side by side are read alike.
Scale common_scale(const std::vector<std::vector<double>>& panels);

/// An axis x of values, at least one; a logarithmic one with tics at 1, 2 and 5 where decades alone would be
/// few.
std::string value_axis(const std::vector<double>& values, Scale scale);

/// A quantile of sorted values, between neighbours; at least one value.
double quantile(const std::vector<double>& sorted, double share);

/// Text as gnuplot takes it between single quotes, without its own markup.
std::string plain(const std::string& text);

/// The same of a mark on an axis, which gnuplot reads as a format; of a long one, its end.
std::string tic_label(const std::string& text);

/// The names as marks at 0, 1, 2, ..., for `set ytics (...)`; beside a panel that has them, empty names.
std::string named_tics(const std::vector<std::string>& names);

}  // namespace unhand::apps
