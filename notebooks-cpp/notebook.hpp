// What a notebook does beside computing: it checks its numbers and shows its figures.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "apps/figure.hpp"

namespace unhand::notebook {

using apps::Figure;

/// Prints what was checked, with a tick. Where it does not hold it says so, and the notebook fails: its cell
/// in Jupyter, its program among the tests.
void check(bool holds, const std::string& what);

/// How many checks have failed.
int failures();

/// Draws the figure into the folder that UNHAND_NOTEBOOK_FIGURES names, or else a temporary one, and shows it
/// below the cell. Without gnuplot it says that there is none.
void show(const Figure& figure);

/// A file or folder of the data folder, which UNHAND_DATA names; nothing where it is missing, and says so.
std::optional<std::filesystem::path> data(const std::string& inside);

}  // namespace unhand::notebook
