#include "apps/report_page.hpp"

#include <fmt/format.h>

#include <fstream>
#include <iterator>

namespace unhand::apps {
namespace {

std::string base64(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(in)), {});
  constexpr char kAlphabet[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    unsigned block = 0;
    for (std::size_t k = 0; k < 3; ++k)
      block = block << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u);
    for (std::size_t k = 0; k < 4; ++k)
      out += i + k <= bytes.size() ? kAlphabet[block >> (18 - 6 * k) & 63] : '=';
  }
  return out;
}

// On paper the widest table, of ten columns, has 18 cm, and no row or figure is cut by the end of a page.
constexpr const char* kStyle =
    "body{font:15px/1.45 sans-serif;max-width:60em;margin:2em auto;padding:0 1em}"
    "table{border-collapse:collapse;margin:1em 0;font-size:13px}"
    "td,th{padding:.15em .7em;border-bottom:1px solid #ddd;text-align:left}"
    ".n{text-align:right}td.n{white-space:nowrap;font-variant-numeric:tabular-nums}"
    "img{max-width:100%}code{background:#f3f3f3;padding:.1em .3em}"
    "@page{margin:15mm}"
    "@media print{body{font-size:9.5pt;max-width:none;margin:0;padding:0}table{font-size:7.5pt}"
    "td,th{padding:.1em .4em}tr,img{break-inside:avoid}h2,h3{break-after:avoid}}";

}  // namespace

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text)
    out += c == '<' ? "&lt;" : c == '>' ? "&gt;" : c == '&' ? "&amp;" : std::string(1, c);
  return out;
}

std::string html(const Table& table) {
  const auto kind = [&](std::size_t i) { return static_cast<int>(i) < table.left ? "" : " class=n"; };
  std::string out = "<table><thead><tr>";
  for (std::size_t i = 0; i < table.header.size(); ++i)
    out += fmt::format("<th{}>{}</th>", kind(i), escaped(table.header[i]));
  out += "</tr></thead><tbody>";
  for (const auto& row : table.rows) {
    out += "<tr>";
    for (std::size_t i = 0; i < row.size(); ++i)
      out += fmt::format("<td{}>{}</td>", kind(i), escaped(row[i]));
    out += "</tr>";
  }
  return out + "</tbody></table>\n";
}

std::string html_picture(const std::filesystem::path& png, const std::string& alt) {
  return fmt::format("<img src=\"data:image/png;base64,{}\" alt=\"{}\">\n", base64(png), escaped(alt));
}

std::string html_page(const std::string& title, const std::string& body) {
  return fmt::format(
      "<!DOCTYPE html><html lang=en><meta charset=utf-8><title>{0}</title>\n"
      "<style>{1}</style>\n<h1>{0}</h1>\n{2}</html>\n",
      escaped(title), kStyle, body);
}

}  // namespace unhand::apps
