// Building blocks of self-contained HTML pages.
#pragma once

#include <filesystem>
#include <string>

#include "apps/table.hpp"

namespace unhand::apps {

std::string escaped(const std::string& text);
std::string html(const Table& table);
/// <img> with the file's bytes inside.
std::string html_picture(const std::filesystem::path& png, const std::string& alt);
/// A page with the house's style around `body`.
std::string html_page(const std::string& title, const std::string& body);

}  // namespace unhand::apps
