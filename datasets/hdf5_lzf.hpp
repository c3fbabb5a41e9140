// LZF, the other compression that h5py offers by name. Included by .cpp files of this module only.
#pragma once

namespace unhand::datasets::hdf5 {

/// HDF5 reads datasets that are compressed with LZF from here on. Nothing is written with it. While a Session
/// lives.
void read_lzf();

}  // namespace unhand::datasets::hdf5
