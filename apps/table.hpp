// A table of text, for the terminal, for Markdown and for CSV.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace unhand::apps {

/// The first `left` columns are aligned left, the others right.
struct Table {
  std::vector<std::string> header;
  std::vector<std::vector<std::string>> rows;
  int left{1};

  std::string text() const;  ///< aligned with spaces, a rule below the header
  std::string markdown() const;
  std::string csv() const;  ///< RFC 4180
};

/// Text of a log or a file, such as a name, as Markdown shows it: without markup or HTML of its own.
std::string markdown_text(const std::string& text);

/// value ± spread with so many decimals; a dash if there is nothing to show.
std::string plus_minus(bool known, double value, double spread, int decimals);
/// The same of n numbers: a single one has no spread, for which a dash stands.
std::string mean_and_spread(std::size_t n, double mean, double spread, int decimals);

/// A value and its sigma as far as the sigma's two leading digits, for people; JSON has all digits.
struct Rounded {
  std::string value, sigma;     ///< as text, of the same digits
  std::optional<int> decimals;  ///< after the point; none where those are too many, or sigma is no size
};
Rounded rounded(double value, double sigma);
/// Whether the sigma is but rounding errors: the value was held, at an end of its range for instance.
bool is_held(double value, double sigma);
/// "19.7 ± 1.1 m/s", "1 (held)"; no unit for "-".
std::string with_sigma(double value, double sigma, const std::string& unit);
/// With so many decimals, and never -0; a dash if it is not known.
std::string fixed(bool known, double value, int decimals);
/// The same with its sign, + for 0.
std::string with_sign(double value, int decimals);
/// A p-value's two leading digits; what rounds to 0 is "< 1e-300".
std::string p_text(double p_value);
/// As many decimals as there are, for CSV; empty if it is not known.
std::string all_digits(bool known, double value);
/// "1 throw", "2 throws".
std::string plural(std::size_t n, const char* what);

}  // namespace unhand::apps
