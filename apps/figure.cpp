#include "apps/figure.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <sstream>
#include <stdexcept>

#include "apps/command.hpp"
#include "apps/interruption.hpp"
#include "apps/output.hpp"

namespace unhand::apps {
namespace {

namespace fs = std::filesystem;

/// Where the shell would find the program; empty if nowhere.
fs::path find_program(const std::string& name) {
  const char* path = std::getenv("PATH");
  std::istringstream folders(path != nullptr ? path : "");
  for (std::string folder; std::getline(folders, folder, ':');) {
    const fs::path candidate = fs::path(folder.empty() ? "." : folder) / name;
    if (access(candidate.c_str(), X_OK) == 0) return fs::absolute(candidate);
  }
  return {};
}

fs::path gnuplot() {
  const fs::path program = find_program("gnuplot");
  if (program.empty())
    throw Unanswered("figures need the program gnuplot, which is not installed (Debian package gnuplot-nox)");
  return program;
}

/// Runs the program in a folder. Gives its exit status (-1: it died) and what it wrote on stderr.
std::pair<int, std::string> run(const fs::path& program, const std::string& argument,
                                const fs::path& folder) {
  std::array<int, 2> ends{};
  if (pipe(ends.data()) != 0) throw Unanswered("cannot make a pipe to gnuplot");
  const pid_t child = fork();
  if (child < 0) throw Unanswered("cannot start gnuplot");
  if (child == 0) {
    setpgid(0, 0);  // an interruption from the terminal is ours: it kills gnuplot
    const int nowhere = open("/dev/null", O_RDWR);
    dup2(nowhere, STDIN_FILENO);
    dup2(nowhere, STDOUT_FILENO);
    dup2(ends[1], STDERR_FILENO);
    close(ends[0]);
    if (chdir(folder.c_str()) == 0)
      execl(program.c_str(), program.c_str(), argument.c_str(), static_cast<char*>(nullptr));
    _exit(127);
  }
  end_with_us(child);
  close(ends[1]);
  std::string said;
  std::array<char, 4096> block{};
  for (ssize_t n = 0; (n = read(ends[0], block.data(), block.size())) != 0;) {
    if (n > 0) said.append(block.data(), static_cast<std::size_t>(n));
    if (n < 0 && errno != EINTR) break;
  }
  close(ends[0]);
  end_with_us(0);
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, said};
}

std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    out += c == '\n' ? ' ' : c;
  }
  return out + "\"";
}

std::string data_text(const Figure& figure) {
  std::string out;
  for (std::size_t b = 0; b < figure.data.size(); ++b) {
    const DataBlock& block = figure.data[b];
    if (b > 0) out += "\n\n";
    out += fmt::format("# {}: {}\n#", b, quoted(block.title));
    for (const auto& column : block.columns) out += fmt::format(" {}", quoted(column));
    out += "\n";
    for (std::size_t i = 0; i < block.rows.size(); ++i) {
      for (const double value : block.rows[i]) {
        if (!std::isfinite(value))
          throw std::logic_error("figure " + figure.name + ": a number is not finite");
        out += fmt::format("{} ", value);
      }
      if (!block.labels.empty()) out += quoted(block.labels[i]);
      out += "\n";
    }
    // gnuplot's index skips blocks without rows and so would draw the next one in this one's place.
    if (block.rows.empty())
      for (std::size_t k = 0; k <= block.columns.size(); ++k)
        out += k < block.columns.size() ? "NaN " : "# no rows\n";
  }
  return out;
}

std::string script_text(const Figure& figure) {
  constexpr double pixels_per_cm = 100;
  std::string body;
  std::istringstream lines(figure.script);
  for (std::string line; std::getline(lines, line);) body += "  " + line + "\n";
  return fmt::format(
      "# Draws {0}.png and {0}.pdf from {0}.dat:  gnuplot {0}.gp\n"
      "set encoding utf8\n"
      "DATA = '{0}.dat'\n"
      "do for [format in 'png pdf'] {{\n"
      "  reset\n"
      "  if (format eq 'png') {{\n"
      "    set terminal pngcairo size {1:.0f},{2:.0f} font 'DejaVu Sans,9' fontscale 2.6 linewidth 2.6 "
      "pointscale 2.2 "
      "dashlength 0.7 background rgb 'white'\n"
      "  }} else {{\n"
      "    set terminal pdfcairo size {3}cm,{4}cm font 'DejaVu Sans,9' linewidth 1.4 pointscale 0.5 "
      "dashlength 0.7\n"
      "  }}\n"
      "  set output '{0}.'.format\n"
      "  set border 3 linecolor rgb '#404040' linewidth 0.7\n"
      "  set tics nomirror out scale 0.5 textcolor rgb '#202020'\n"
      "  set format '%h'\n"
      "  set grid linetype 1 linecolor rgb '#e2e2e2' linewidth 0.5\n"
      "{5}"
      "  set output\n"
      "}}\n",
      figure.name, figure.width * pixels_per_cm, figure.height * pixels_per_cm, figure.width, figure.height,
      body);
}

}  // namespace

void require_gnuplot() { gnuplot(); }

std::string file_stem(const std::string& text) {
  std::string out = text;
  for (char& c : out)
    if (const bool ascii = static_cast<unsigned char>(c) < 128;
        !ascii || (!std::isalnum(static_cast<unsigned char>(c)) && c != '.' && c != '_' && c != '-'))
      c = '_';
  return out;
}

void draw(const Figure& figure, const fs::path& directory, const std::string& about) {
  const Unbroken here;
  if (figure.name != file_stem(figure.name))
    throw std::logic_error("figure: the name " + figure.name + " is none for a file");
  const fs::path program = gnuplot();
  const std::string comment = "# " + quoted(about) + "\n";
  write_text(directory / (figure.name + ".dat"), comment + data_text(figure));
  write_text(directory / (figure.name + ".gp"), comment + script_text(figure));
  const auto [status, said] = run(program, figure.name + ".gp", directory);
  if (status != 0)
    throw Unanswered(fmt::format("gnuplot could not draw {} (status {}):\n{}", figure.name, status, said));
  const std::string file = (directory / figure.name).string();
  require_whole(file + ".png", "IEND", said);
  require_whole(file + ".pdf", "%%EOF", said);
}

Style style_of(const std::string& model) {
  // The palette of Okabe and Ito, which colour-blind eyes tell apart.
  struct Entry {
    const char* model;
    Style style;
  };
  static const Entry known[] = {{"sliding_pivot", {7, "#0072b2", 1}},           // disc
                                {"limit_surface", {9, "#d55e00", 2}},           // triangle
                                {"limit_surface_disc", {4, "#000000", 3}},      // open square
                                {"limit_surface_quartic", {12, "#cc79a7", 4}},  // open diamond
                                {"gripper_delay", {2, "#56b4e9", 5}},           // cross
                                {"limit_surface_naive", {1, "#e69f00", 4}},     // plus
                                {"ellipsoid", {7, "#0072b2", 2}},
                                {"ellipsoid_full", {9, "#d55e00", 4}},
                                {"convex_quartic", {4, "#000000", 1}},
                                {"projectile", {7, "#0072b2", 1}}};
  for (const Entry& entry : known)
    if (model == entry.model) return entry.style;
  return {6, "#009e73", 3};  // ring
}

std::string place(const Figure& figure, const Panel& panel) {
  return fmt::format(
      "set lmargin at screen {:.4f}; set rmargin at screen {:.4f}\n"
      "set bmargin at screen {:.4f}; set tmargin at screen {:.4f}\n",
      panel.left / figure.width, panel.right / figure.width, panel.bottom / figure.height,
      panel.top / figure.height);
}

std::string key_strip(const Figure& figure, const std::vector<KeyEntry>& entries, int columns) {
  std::string out = place(figure, {0.2, figure.width - 0.2, 0.1, 0.1 + key_height(entries.size(), columns)});
  out += fmt::format(
      "unset border; unset tics; unset grid; unset title; unset xlabel; unset ylabel; unset arrow; unset "
      "object\n"
      "unset logscale; unset xzeroaxis; unset yzeroaxis\n"
      "set key inside center center horizontal maxcols {} samplen 2.5 width 1 spacing 1.1 Left reverse\n"
      "plot [0:1] [0:1] 2 notitle",
      columns);
  for (const KeyEntry& entry : entries)
    out += fmt::format(", \\\n     keyentry {} title '{}'", entry.style, plain(entry.title));
  return out + "\n";
}

double tic_step(double high) {
  if (!(high > 0)) return 1;
  const double raw = high / 3, decade = std::pow(10, std::floor(std::log10(raw)));
  return decade * (raw >= 5 * decade ? 5 : raw >= 2 * decade ? 2 : 1);
}

Scale common_scale(const std::vector<std::vector<double>>& panels) {
  bool wide = false;
  for (const auto& values : panels) {
    const auto [low, high] = std::minmax_element(values.begin(), values.end());
    if (!(*low > 0)) return Scale::linear;
    wide = wide || *high / *low > 20;
  }
  return wide ? Scale::logarithmic : Scale::linear;
}

std::string value_axis(const std::vector<double>& values, Scale scale) {
  const auto [low, high] = std::minmax_element(values.begin(), values.end());
  if (scale == Scale::linear)
    return fmt::format("unset logscale x; set xtics {:.6g}\nset xrange [0:{:.6g}]\n", tic_step(*high),
                       *high > 0 ? 1.08 * *high : 1);
  const double left = *low / 1.4, right = *high * 1.4;
  std::string out = fmt::format("set logscale x\nset xrange [{:.6g}:{:.6g}]\n", left, right);
  if (right / left > 300) return out + "set xtics autofreq\n";
  std::string tics;
  for (double decade = std::pow(10, std::floor(std::log10(left))); decade < right; decade *= 10)
    for (const int digit : {1, 2, 5})
      tics += fmt::format("{}{:.6g}", tics.empty() ? "" : ", ", digit * decade);
  return out + fmt::format("set xtics ({})\n", tics);
}

double quantile(const std::vector<double>& sorted, double share) {
  const double at = share * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<std::size_t>(at);
  const double above = sorted[std::min(below + 1, sorted.size() - 1)];
  return sorted[below] + (at - static_cast<double>(below)) * (above - sorted[below]);
}

std::string plain(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '\'') out += '\'';
    if (c == '_' || c == '^' || c == '{' || c == '}' || c == '@' || c == '&' || c == '~') out += '\\';
    if (c == '\\')
      out += "∖";  // set minus: the terminals swallow a backslash, or draw two
    else
      out += c == '\n' ? ' ' : c;
  }
  return out;
}

namespace {

/// As much of a name's end as has room beside a panel: names of conditions differ there.
std::string shortened(const std::string& text) {
  constexpr std::ptrdiff_t kMost = 38;  // characters
  const auto begins = [](char c) { return (static_cast<unsigned char>(c) & 0xc0) != 0x80; };
  const auto length = std::count_if(text.begin(), text.end(), begins);
  if (length <= kMost) return text;
  std::ptrdiff_t skipped = 0;
  const auto from = std::find_if(text.begin(), text.end(),
                                 [&](char c) { return begins(c) && skipped++ == length - (kMost - 1); });
  return "…" + std::string(from, text.end());
}

}  // namespace

std::string tic_label(const std::string& text) {
  std::string out;
  for (const char c : plain(shortened(text))) out += c == '%' ? std::string("%%") : std::string(1, c);
  return out;
}

std::string named_tics(const std::vector<std::string>& names) {
  std::string out;
  for (std::size_t i = 0; i < names.size(); ++i)
    out += fmt::format("{}'{}' {}", i > 0 ? ", " : "", tic_label(names[i]), i);
  return out;
}

}  // namespace unhand::apps
