// What the children that read HDF5 files do (hdf5_apart.hpp), callable in this process for the fuzzers, which
// must see inside. Private to the module.
#pragma once

#include <string>

#include "datasets/slip_log.hpp"
#include "datasets/throw_log.hpp"

namespace unhand::datasets::hdf5 {

class Place;

/// The log as it is in the file: shapes, types and units hold, values are not validated. Needs the Session of
/// its caller. `place` may be null. Throws LogError.
ThrowLog parse_throw_log(const std::string& file, Place* place);
/// The same of a slip log.
SlipLog parse_slip_log(const std::string& file, Place* place);

}  // namespace unhand::datasets::hdf5
