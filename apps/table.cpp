#include "apps/table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "dynamics/effect.hpp"

namespace unhand::apps {
namespace {

/// Columns on a terminal: UTF-8 continuation bytes take none.
std::size_t width(const std::string& text) {
  return static_cast<std::size_t>(std::count_if(
      text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xc0) != 0x80; }));
}

std::string csv_cell(const std::string& cell) {
  if (cell.find_first_of(",\"\n\r") == std::string::npos) return cell;
  std::string out(1, '"');
  for (const char c : cell) {
    if (c == '"') out += '"';
    out += c;
  }
  out += '"';
  return out;
}

}  // namespace

std::string Table::text() const {
  std::vector<std::size_t> widths(header.size());
  const auto widen = [&](const std::vector<std::string>& row) {
    for (std::size_t j = 0; j < row.size(); ++j) widths[j] = std::max(widths[j], width(row[j]));
  };
  widen(header);
  for (const auto& row : rows) widen(row);
  const auto line = [&](const std::vector<std::string>& row) {
    std::string out;
    for (std::size_t j = 0; j < row.size(); ++j) {
      const std::string space(widths[j] - width(row[j]), ' ');
      if (j > 0) out += "  ";
      out += static_cast<int>(j) < left ? row[j] + space : space + row[j];
    }
    out.erase(out.find_last_not_of(' ') + 1);
    return out + "\n";
  };
  std::size_t total = 2 * (widths.size() - 1);
  for (const std::size_t w : widths) total += w;
  std::string out = line(header) + std::string(total, '-') + "\n";
  for (const auto& row : rows) out += line(row);
  return out;
}

std::string Table::markdown() const {
  const auto line = [](const std::vector<std::string>& row) {
    std::string out = "|";
    for (const auto& cell : row) {
      out += ' ' + markdown_text(cell) + " |";
    }
    return out + "\n";
  };
  std::string out = line(header) + "|";
  for (std::size_t j = 0; j < header.size(); ++j) out += static_cast<int>(j) < left ? " --- |" : " ---: |";
  out += "\n";
  for (const auto& row : rows) out += line(row);
  return out;
}

std::string markdown_text(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '<' || c == '&') {
      out += c == '<' ? "&lt;" : "&amp;";
      continue;
    }
    if (c == '|' || c == '*' || c == '`' || c == '\\') out += '\\';
    out += c;
  }
  return out;
}

std::string Table::csv() const {
  std::string out;
  const auto line = [&](const std::vector<std::string>& row) {
    for (std::size_t j = 0; j < row.size(); ++j) {
      if (j > 0) out += ',';
      out += csv_cell(row[j]);
    }
    out += "\n";
  };
  line(header);
  for (const auto& row : rows) line(row);
  return out;
}

std::string fixed(bool known, double value, int decimals) {
  if (!known) return "-";
  std::string out = fmt::format("{:.{}f}", value, decimals);
  if (out.find_first_not_of("-0.") == std::string::npos) out.erase(0, out.find('0'));
  return out;
}

std::string all_digits(bool known, double value) { return known ? fmt::format("{}", value) : std::string(); }

std::string with_sign(double value, int decimals) {
  const std::string out = fixed(true, value, decimals);
  return out.starts_with('-') ? out : "+" + out;
}

std::string plus_minus(bool known, double value, double spread, int decimals) {
  return known ? fmt::format("{:.{}f} ± {:.{}f}", value, decimals, spread, decimals) : "-";
}

std::string mean_and_spread(std::size_t n, double mean, double spread, int decimals) {
  return n == 1 ? fmt::format("{:.{}f} ± -", mean, decimals) : plus_minus(n > 0, mean, spread, decimals);
}

std::string p_text(double p_value) {
  constexpr double kLeast = 1e-300;
  return p_value < kLeast ? fmt::format("< {:g}", kLeast) : fmt::format("{:.2g}", p_value);
}

std::string plural(std::size_t n, const char* what) {
  return fmt::format("{} {}{}", n, what, n == 1 ? "" : "s");
}

bool is_held(double value, double sigma) { return sigma <= 1e-12 * std::abs(value); }

Rounded rounded(double value, double sigma) {
  if (!(sigma > 0) || !std::isfinite(sigma) || !std::isfinite(value))
    return {fmt::format("{:.6g}", value), fmt::format("{:.2g}", sigma), {}};
  constexpr int most = 7;  // digits after the point that are still read at a glance
  const std::string two = fmt::format("{:.1e}", sigma);  // rounded first: 0.0996 is 0.10
  const int power = std::atoi(two.c_str() + two.find('e') + 1), decimals = 1 - power;
  if (decimals > most) {
    const int digits = value == 0 ? 1 : static_cast<int>(std::floor(std::log10(std::abs(value)))) - power + 2;
    return {fmt::format("{:.{}g}", value, std::clamp(digits, 1, 17)), fmt::format("{:.2g}", sigma), {}};
  }
  const double unit = std::pow(10.0, -decimals);  // 123456 ± 2300 is 123500 ± 2300
  const auto shown = [&](double x) {
    return fmt::format("{:.{}f}", decimals < 0 ? unit * std::round(x / unit) : x, std::max(0, decimals));
  };
  return {shown(value), shown(sigma), std::max(0, decimals)};
}

std::string with_sigma(double value, double sigma, const std::string& unit) {
  const Rounded r = rounded(value, sigma);
  const std::string with_unit = dynamics::after_number(unit);
  if (is_held(value, sigma)) return fmt::format("{}{} (held)", r.value, with_unit);
  return fmt::format("{} ± {}{}", r.value, r.sigma, with_unit);
}

}  // namespace unhand::apps
