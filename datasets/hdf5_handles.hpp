// HDF5's C API in handles that close themselves. Included by .cpp files of this module only.
#pragma once

#include <hdf5.h>

#include <mutex>
#include <string>
#include <string_view>
#include <utility>

namespace unhand::datasets::hdf5 {

/// An identifier and the function that gives it back.
class Handle {
 public:
  using Close = herr_t (*)(hid_t);
  Handle() = default;
  Handle(hid_t id, Close how) : id_(id), close_(how) {}
  Handle(Handle&& other) noexcept : id_(std::exchange(other.id_, H5I_INVALID_HID)), close_(other.close_) {}
  Handle& operator=(Handle&& other) noexcept {
    std::swap(id_, other.id_);
    std::swap(close_, other.close_);
    return *this;
  }
  ~Handle() { close(); }

  explicit operator bool() const { return id_ >= 0; }
  hid_t id() const { return id_; }
  /// False when HDF5 could not finish (a full disk shows up here).
  bool close() {
    const hid_t id = std::exchange(id_, H5I_INVALID_HID);
    return id < 0 || close_(id) >= 0;
  }

 private:
  hid_t id_ = H5I_INVALID_HID;
  Close close_ = nullptr;
};

inline Handle file_handle(hid_t id) { return {id, H5Fclose}; }
inline Handle group_handle(hid_t id) { return {id, H5Gclose}; }
inline Handle object_handle(hid_t id) { return {id, H5Oclose}; }
inline Handle dataset_handle(hid_t id) { return {id, H5Dclose}; }
inline Handle attribute_handle(hid_t id) { return {id, H5Aclose}; }
inline Handle type_handle(hid_t id) { return {id, H5Tclose}; }
inline Handle space_handle(hid_t id) { return {id, H5Sclose}; }
inline Handle list_handle(hid_t id) { return {id, H5Pclose}; }

/// While one lives, HDF5 prints nothing and this thread alone uses it (Debian's library is not thread-safe).
class Session {
 public:
  Session() : lock_(mutex()) {
    H5Eget_auto2(H5E_DEFAULT, &print_, &data_);
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  }
  ~Session() { H5Eset_auto2(H5E_DEFAULT, print_, data_); }
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

 private:
  static std::mutex& mutex() {
    static std::mutex instance;
    return instance;
  }
  std::lock_guard<std::mutex> lock_;
  H5E_auto2_t print_ = nullptr;
  void* data_ = nullptr;
};

/// What HDF5 itself said about the call that just failed: its innermost message, of the system's errors what
/// the system said.
inline std::string last_message() {
  std::string text;
  const auto take = [](unsigned depth, const H5E_error2_t* error, void* out) -> herr_t {
    if (depth == 0 && error->desc != nullptr) *static_cast<std::string*>(out) = error->desc;
    return 0;
  };
  H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, take, &text);
  constexpr std::string_view of_system = "error message = '";
  if (const auto at = text.find(of_system); at != std::string::npos) {
    const std::string said = text.substr(at + of_system.size());
    return said.substr(0, said.find('\''));
  }
  return text.empty() ? "no detail" : text;
}

/// "wrong type: ..., expected".
inline std::string_view class_name(H5T_class_t kind) {
  switch (kind) {
    case H5T_INTEGER:
      return "integers";
    case H5T_FLOAT:
      return "floating-point numbers";
    case H5T_STRING:
      return "text";
    case H5T_COMPOUND:
      return "compound values";
    case H5T_REFERENCE:
      return "references";
    case H5T_ENUM:
      return "an enumeration";
    case H5T_ARRAY:
      return "arrays";
    case H5T_VLEN:
      return "variable-length lists";
    default:
      return "opaque values";
  }
}

}  // namespace unhand::datasets::hdf5
