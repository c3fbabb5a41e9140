// HDF5's access to a file, read only and without gathering small reads. Private to the module.
#pragma once

#include <hdf5.h>

namespace unhand::datasets::hdf5 {

/// Registers the driver with a list of file access properties. Negative where HDF5 refuses it.
///
/// HDF5 1.10's own drivers gather small reads (H5F__accum_read), and crash there on some damaged addresses; a
/// read past the end of this file is an error like any other. It also goes round for ever in a damaged global
/// heap (hdf5_global_heap.hpp), which is an error here as well.
herr_t read_plainly(hid_t access);

}  // namespace unhand::datasets::hdf5
