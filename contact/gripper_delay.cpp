#include "contact/gripper_delay.hpp"

#include <fmt/core.h>

#include <cmath>
#include <stdexcept>

#include "contact/contact_model_from.hpp"

namespace unhand::contact {

GripperDelay::GripperDelay(double open_command, const Dual& delay)
    : open_command_(open_command), delay_(delay) {
  if (!std::isfinite(open_command))
    throw std::invalid_argument(
        fmt::format("gripper delay: open_command = {} s is not finite", open_command));
  if (!(delay.a >= 0 && delay.a <= 10))
    throw std::invalid_argument(fmt::format("gripper delay: delay = {} is not in [0, 10] s", delay.a));
}

template class ContactModelFrom<GripperDelay>;

}  // namespace unhand::contact
