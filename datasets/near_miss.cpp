#include "datasets/near_miss.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <vector>

namespace unhand::datasets {
namespace {

char lower(char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; }
bool is_letter_or_digit(char c) { return (c >= '0' && c <= '9') || (lower(c) >= 'a' && lower(c) <= 'z'); }

/// "ftt", "f_t" or "fts" for "ft"; "ft2" is another name.
bool has_one_too_many(std::string_view name, std::string_view known) {
  for (std::size_t i = 0; i < name.size(); ++i) {
    std::string rest(name);
    rest.erase(i, 1);
    if (edit_distance(rest, known) != 0) continue;
    const bool doubled = i > 0 && lower(name[i]) == lower(name[i - 1]);
    const bool plural = i + 1 == name.size() && lower(name[i]) == 's';
    if (doubled || plural || !is_letter_or_digit(name[i])) return true;
  }
  return false;
}

/// "7" of "007", "0" of "00"; nothing of what is no number.
std::string_view without_zeros(std::string_view name) {
  if (name.empty() || name.find_first_not_of("0123456789") != std::string_view::npos) return {};
  return name.substr(std::min(name.find_first_not_of('0'), name.size() - 1));
}

}  // namespace

int edit_distance(std::string_view a, std::string_view b) {
  const std::size_t n = a.size(), m = b.size();
  std::vector<int> before(m + 1), last(m + 1), now(m + 1);
  for (std::size_t j = 0; j <= m; ++j) last[j] = static_cast<int>(j);
  for (std::size_t i = 1; i <= n; ++i) {
    now[0] = static_cast<int>(i);
    for (std::size_t j = 1; j <= m; ++j) {
      const bool same = lower(a[i - 1]) == lower(b[j - 1]);
      now[j] = std::min({last[j] + 1, now[j - 1] + 1, last[j - 1] + (same ? 0 : 1)});
      const bool swapped =
          i > 1 && j > 1 && lower(a[i - 1]) == lower(b[j - 2]) && lower(a[i - 2]) == lower(b[j - 1]);
      if (swapped) now[j] = std::min(now[j], before[j - 2] + 1);
    }
    before.swap(last);
    last.swap(now);
  }
  return last[m];
}

bool is_near_miss(std::string_view name, std::string_view known) {
  if (name == known || name.size() > known.size() + 2) return false;  // also keeps absurdly long names cheap
  const int distance = edit_distance(name, known);
  if (known.size() <= 3) {
    const auto equal = [](char a, char b) { return lower(a) == lower(b); };
    return distance <= 1 &&
           (std::is_permutation(name.begin(), name.end(), known.begin(), known.end(), equal) ||
            has_one_too_many(name, known));
  }
  return distance <= (known.size() <= 5 ? 1 : 2);
}

std::string_view nearest_name(std::string_view name, std::span<const std::string_view> known) {
  std::string_view best;
  int best_distance = 3;
  for (const std::string_view candidate : known) {
    if (!is_near_miss(name, candidate)) continue;
    const int distance = edit_distance(name, candidate);
    if (distance < best_distance) {
      best = candidate;
      best_distance = distance;
    }
  }
  return best;
}

std::string_view meant_name(std::string_view name, std::span<const std::string_view> known) {
  if (const std::string_view nearest = nearest_name(name, known); !nearest.empty()) return nearest;
  const std::string_view number = without_zeros(name);
  std::vector<std::string_view> same, last;
  for (const std::string_view one : known) {
    if (!number.empty() && without_zeros(one) == number) same.push_back(one);
    if (const std::size_t dot = one.find('.'); dot != std::string_view::npos)
      last.push_back(one.substr(dot + 1));
  }
  if (same.size() == 1) return same.front();
  std::string_view meant = name;
  if (std::find(last.begin(), last.end(), name) == last.end()) meant = nearest_name(name, last);
  if (meant.empty() || std::count(last.begin(), last.end(), meant) != 1) return {};
  return *std::find_if(known.begin(), known.end(), [&](std::string_view one) {
    const std::size_t dot = one.find('.');
    return dot != std::string_view::npos && one.substr(dot + 1) == meant;
  });
}

std::string unknown_name(const std::string& said, std::string_view name,
                         const std::vector<std::string>& known) {
  const std::vector<std::string_view> views(known.begin(), known.end());
  const std::string_view meant = meant_name(name, views);
  if (!meant.empty()) return fmt::format("{}; did you mean '{}'?", said, meant);
  const std::string_view family = name.substr(0, name.find('.') + 1);  // "flight."; none: empty
  const auto listed = [&](std::string_view prefix) {
    std::vector<std::string_view> out;
    for (const std::string_view view : views)
      if (!view.empty() && view.starts_with(prefix)) out.push_back(view);
    return out;
  };
  auto some = listed(family);
  if (some.empty()) some = listed("");
  constexpr std::size_t kMost = 12;
  const bool more = some.size() > kMost;
  if (more) some.resize(kMost);
  return fmt::format("{} (there are: {}{})", said, fmt::join(some, ", "), more ? ", ..." : "");
}

}  // namespace unhand::datasets
