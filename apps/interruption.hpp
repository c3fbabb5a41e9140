// What a run leaves that SIGINT, SIGTERM or SIGHUP ends: nothing unfinished.
#pragma once

#include <sys/types.h>

#include <filesystem>

namespace unhand::apps {

/// From here on a thread waits for these signals. It kills the child of end_with_us(), lets what is Unbroken
/// finish, removes what remove_if_interrupted() names, and ends the process by the signal (a shell shows 130,
/// 143 or 129). To be called before other threads start; signals that are ignored stay so. Children that are
/// forked later get the signals as before. A file beyond the limit of its size is an error, no signal.
void end_tidily();

/// While one lives, an interruption waits; once one has begun, nothing becomes Unbroken any more, and the
/// thread that asks for it never comes back. May be nested.
class Unbroken {
 public:
  Unbroken();
  ~Unbroken();
  Unbroken(const Unbroken&) = delete;
  Unbroken& operator=(const Unbroken&) = delete;
};

/// A file or directory, with all that is in it; relative to the present working directory.
void remove_if_interrupted(const std::filesystem::path& path);
/// No longer.
void keep_if_interrupted(const std::filesystem::path& path);

/// The one child that an interruption kills; 0: none.
void end_with_us(pid_t child);

/// Does not come back once an interruption has begun: before an error that it may have caused is told.
void wait_if_interrupted();

}  // namespace unhand::apps
