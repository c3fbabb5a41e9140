// A table of text, for the terminal, for Markdown and for CSV.
#pragma once

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

/// value ± spread with so many decimals; a dash if there is nothing to show.
std::string plus_minus(bool known, double value, double spread, int decimals);
std::string fixed(bool known, double value, int decimals);

}  // namespace unhand::apps
