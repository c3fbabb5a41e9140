#include "fitting/discovery/verdict.hpp"

namespace unhand::fitting {

const char* to_string(Verdict verdict) {
  switch (verdict) {
    case Verdict::effect_found:
      return "effect_found";
    case Verdict::no_missing_effect:
      return "no_missing_effect";
    case Verdict::unexplained:
      return "unexplained";
    case Verdict::not_answered:
      return "not_answered";
  }
  return "";
}

}  // namespace unhand::fitting
