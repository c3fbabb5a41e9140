// A notebook as a program: extract NOTEBOOK.ipynb PROGRAM.cpp
//
// Code cells become the body of main(), in order, so that what one cell names the next ones see. Lines with
// #include go to the top, cells whose first line is "// at namespace scope" before main(), and lines that
// begin with % are the kernel's and are left out. #line directives lead errors back to the cell.
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

namespace {

constexpr std::string_view kOutside = "// at namespace scope";

std::string joined(const nlohmann::json& source) {
  if (source.is_string()) return source.get<std::string>();
  std::string out;
  for (const auto& line : source) out += line.get<std::string>();
  return out;
}

struct Program {
  std::string includes, outside, body;

  void add(const std::string& name, int cell, const std::string& source) {
    std::string& into = source.rfind(kOutside, 0) == 0 ? outside : body;
    into += "#line 1 \"" + name + ", cell " + std::to_string(cell) + "\"\n";
    std::istringstream lines(source);
    for (std::string line; std::getline(lines, line);) {
      const bool include = line.rfind("#include", 0) == 0, magic = line.rfind("%", 0) == 0;
      if (include) includes += line + "\n";
      into += (include || magic ? "" : line) + "\n";
    }
  }

  std::string text() const {
    return "#include \"notebooks-cpp/notebook.hpp\"\n" + includes + outside + "int main() {\n" + body +
           "return unhand::notebook::failures() > 0 ? 1 : 0;\n}\n";
  }
};

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::cerr << "usage: extract NOTEBOOK.ipynb PROGRAM.cpp\n";
    return 2;
  }
  try {
    const std::string file = argv[1];
    std::ifstream in(file);
    const auto notebook = nlohmann::json::parse(in);
    Program program;
    int cell = 0;
    for (const auto& one : notebook.at("cells"))
      if (one.at("cell_type") == "code")
        program.add(file.substr(file.rfind('/') + 1), ++cell, joined(one.at("source")));
    std::ofstream out(argv[2]);
    out << program.text();
    return out ? 0 : 1;
  } catch (const std::exception& error) {
    std::cerr << argv[1] << ": " << error.what() << "\n";
    return 1;
  }
}
