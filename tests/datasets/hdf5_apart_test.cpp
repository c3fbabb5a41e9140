// The process that reads HDF5 files: whatever becomes of it, its parent has an answer and keeps what is its
// own.
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <thread>
#include <vector>

#include "datasets/hdf5_apart.hpp"
#include "datasets/hdf5_handles.hpp"
#include "datasets/log_error.hpp"
#include "datasets/parse_log.hpp"
#include "datasets/throw_log.hpp"
#include "log_samples.hpp"
#include "tests/support/refusal.hpp"

namespace unhand::datasets::test {
namespace {

using hdf5::Limits;
using hdf5::Place;

/// What the parent says of a child that does this while it reads /throws/007@split.
std::string outcome(const std::function<void()>& act, const Limits& limits = {}) {
  const std::string text = support::refusal<LogError>([&] {
    hdf5::read_apart(
        "some.h5",
        [&](Place& place) {
          place.note("/throws/007@split");
          act();
          return [](PipeWriter&) {};
        },
        [](PipeReader&) {}, limits);
  });
  EXPECT_EQ(::waitpid(-1, nullptr, WNOHANG), -1) << "a child is left behind";
  return text;
}

TEST(ReadApart, ADyingReaderIsALogErrorAtItsPlace) {
  const std::string damaged = "some.h5: /throws/007@split: damaged: the HDF5 library could not read it";
  for (const int number : {SIGSEGV, SIGBUS, SIGABRT, SIGFPE, SIGILL}) {
    EXPECT_EQ(outcome([&] { ::raise(number); }), damaged + " (" + ::sigdescr_np(number) + ")");
  }
  EXPECT_EQ(outcome([] { ::_exit(1); }), damaged);  // as sanitizers end a program
  EXPECT_EQ(outcome([] { throw 1; }), damaged);
  EXPECT_NE(outcome([] { ::raise(SIGKILL); }).find("ended from outside"), std::string::npos);
}

TEST(ReadApart, TimeAndSilenceAreLimited) {
  Limits limits;
  limits.cpu_seconds = 1;
  const auto spin = [] {
    for (std::uint64_t k = 0; ::getpid() > 0; ++k) {
    }
  };
  EXPECT_NE(outcome(spin, limits).find("found no end in it within 1 s"), std::string::npos);
  limits.silence_seconds = 1;
  EXPECT_NE(outcome([] { ::sleep(1000); }, limits).find("gave no answer"), std::string::npos);
}

TEST(ReadApart, MemoryIsLimited) {
  Limits limits;
  limits.memory = 64u << 20;
  const auto ask = [] {
    const std::vector<char> much(256u << 20, 'x');
    if (much[much.size() / 2] != 'x') ::_exit(3);
  };
  // a sanitizer ends the program where it would have thrown
  EXPECT_THAT(outcome(ask, limits), testing::AnyOf(testing::HasSubstr("needs more than 64 MiB to read"),
                                                   testing::HasSubstr("damaged")));
  EXPECT_EQ(outcome(ask), "accepted");
}

TEST(ReadApart, AnErrorArrivesAsItWas) {
  const auto refuse = [] { throw LogError("some.h5", "/gripper@n_pads", "0 is not in 1..1000"); };
  EXPECT_EQ(outcome(refuse), "some.h5: /gripper@n_pads: 0 is not in 1..1000");
}

// libhdf5 prints on stdout on some damaged files, and what the parent had not yet written must not come
// twice.
TEST(ReadApart, NothingIsPrinted) {
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  std::printf("once ");
  EXPECT_EQ(outcome([] {
              std::printf("never ");
              std::fprintf(stderr, "never ");
              std::fflush(stdout);
            }),
            "accepted");
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "once ");
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

// A parent that catches signals itself (a test runner, a notebook) does not catch them in the reader.
TEST(ReadApart, HandlersOfTheParentStayThere) {
  const auto old = std::signal(SIGSEGV, [](int) { ::_exit(0); });
  EXPECT_NE(outcome([] { ::raise(SIGSEGV); }).find("damaged"), std::string::npos);
  std::signal(SIGSEGV, old);
}

TEST(ReadApart, ChildrenThatNobodyWaitsForAreNoError) {
  const auto old = std::signal(SIGCHLD, SIG_IGN);
  EXPECT_EQ(outcome([] {}), "accepted");
  EXPECT_NE(outcome([] { ::raise(SIGSEGV); }).find("damaged"), std::string::npos);
  std::signal(SIGCHLD, old);
}

// What is sent half is not taken for whole, and neither is nonsense.
// A parent that is killed while it reads leaves nothing behind: both of the pipe's writers end, and its
// reader comes to the end.
TEST(ReadApart, ADeadParentsReaderEnds) {
  int ends[2];
  ASSERT_EQ(::pipe(ends), 0);
  const pid_t parent = ::fork();
  if (parent == 0) {
    ::close(ends[0]);
    hdf5::read_apart(
        "some.h5",
        [](Place&) {
          return [](PipeWriter& pipe) {
            std::vector<double> more(1 << 20);  // than any pipe holds
            carry(pipe, more);
          };
        },
        [](PipeReader&) { ::raise(SIGKILL); });
    ::_exit(0);
  }
  ::close(ends[1]);
  ASSERT_GT(parent, 0);
  EXPECT_EQ(::waitpid(parent, nullptr, 0), parent);
  pollfd reader{ends[0], POLLIN, 0};
  EXPECT_EQ(::poll(&reader, 1, 10000), 1) << "a child still holds its end after 10 s";
  ::close(ends[0]);
}

TEST(ReadApart, HalfAnAnswerIsNone) {
  for (const int kind : {0, 1, 2}) {
    const auto send = [kind](PipeWriter& pipe) {
      std::uint64_t n = kind == 1 ? kLongestList + 1 : 1000;
      carry(pipe, n);
      pipe.flush();
      if (kind == 0) ::raise(SIGSEGV);
    };
    std::vector<double> values;
    EXPECT_THROW(hdf5::read_apart(
                     "some.h5", [&](Place&) { return hdf5::Send(send); },
                     [&](PipeReader& pipe) { carry(pipe, values); }),
                 LogError);
  }
}

// Every field of a log goes through the pipe: both samples carry all that a log can hold.
TEST(ReadApart, TheLogIsTheOneThatIsReadHere) {
  const Scratch scratch;
  for (ThrowLog log : {planar_log(), spatial_log()}) {
    for (Throw& toss : log.throws) {  // NaN equals nothing
      if (toss.mocap)
        std::replace_if(
            toss.mocap->pose.data.begin(), toss.mocap->pose.data.end(),
            [](double x) { return std::isnan(x); }, 1.0);
    }
    const std::string file = scratch / "log.h5";
    write_throw_log(file, log);
    ThrowLog here;
    {
      const hdf5::Session session;
      here = hdf5::parse_throw_log(file, nullptr);
    }
    EXPECT_EQ(read_throw_log(file), here);
  }
}

TEST(ReadApart, ThreadsReadBesideEachOther) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "AddressSanitizer's allocator hangs in a child that is forked beside allocating threads";
#endif
  const Scratch scratch;
  const std::string file = scratch / "log.h5", bad = scratch / "bad.h5";
  ThrowLog log = planar_log();
  for (Throw& toss : log.throws) toss.mocap.reset();  // its NaN equals nothing
  write_throw_log(file, log);
  put_bytes(bad, bytes_of(file).substr(0, 3000));
  const ThrowLog expected = read_throw_log(file);
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&] {
      for (int k = 0; k < 5; ++k) {
        EXPECT_EQ(read_throw_log(file), expected);
        EXPECT_THROW(read_throw_log(bad), LogError);
      }
    });
  }
  for (auto& thread : threads) thread.join();
}

}  // namespace
}  // namespace unhand::datasets::test
