#include "notebooks-cpp/notebook.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdlib>

#include "apps/command.hpp"

namespace unhand::notebook {

namespace fs = std::filesystem;

namespace {

int failed = 0;

/// The kernel takes lines between these two apart from what a cell prints.
constexpr char kMarkBegin = '\x02', kMarkEnd = '\x03';
bool in_jupyter() { return std::getenv("UNHAND_NOTEBOOK_KERNEL") != nullptr; }
void mark(const std::string& text) {
  if (in_jupyter()) fmt::print("{}{}{}\n", kMarkBegin, text, kMarkEnd);
}

fs::path figures() {
  const char* named = std::getenv("UNHAND_NOTEBOOK_FIGURES");
  const fs::path folder = named != nullptr
                              ? fs::path(named)
                              : fs::temp_directory_path() / fmt::format("unhand-notebook-{}", getpid());
  fs::create_directories(folder);
  return folder;
}

}  // namespace

void check(bool holds, const std::string& what) {
  fmt::print("{} {}\n", holds ? "✓" : "✗ does not hold:", what);
  if (holds) return;
  ++failed;
  mark("failed " + what);
}

int failures() { return failed; }

void show(const Figure& figure) {
  try {
    const fs::path folder = figures();
    draw(figure, folder, "a cell of a notebook, which says of what data");
    const fs::path picture = folder / (figure.name + ".png");
    if (in_jupyter())
      mark("png " + picture.string());
    else
      fmt::print("figure {}\n", picture.string());
  } catch (const apps::Unanswered& error) {
    fmt::print("no figure: {}\n", error.what());
  }
}

std::optional<fs::path> data(const std::string& inside) {
  const char* folder = std::getenv("UNHAND_DATA");
  if (folder == nullptr) {
    fmt::print("UNHAND_DATA names no data folder: {} is not read, and what follows is skipped\n", inside);
    return {};
  }
  fs::path path = fs::path(folder) / inside;
  if (fs::exists(path)) return path;
  fmt::print("the data folder has no {}: what follows is skipped\n", inside);
  return {};
}

}  // namespace unhand::notebook
