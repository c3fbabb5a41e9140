#include "crosscheck/bullet_release.hpp"

#include <btBulletDynamicsCommon.h>
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <vector>

#include "crosscheck/distributed_patch.hpp"

// The float build of Bullet has the same symbols and crashes.
static_assert(sizeof(btScalar) == 8, "Bullet in double precision: pkg-config bullet-float64");

namespace unhand::crosscheck {
namespace {

// Bullet's x and y are the plane's x and z, so that its angles about z are θ; its z is the pads' normal.
constexpr double kHalfThickness = 0.02, kPadHalf = 0.002;  // m
constexpr int kObject = 1, kPad = 2;                       // collision groups: pads do not touch each other

struct Pad {
  std::unique_ptr<btRigidBody> body;
  dynamics::Vec2<double> position;  ///< in the hand's frame [m]
  double share{};                   ///< of one pad's normal force
  double side{};                    ///< ±1
};

class World {
 public:
  World(const release::ReleaseProblem<double>& problem, const contact::Patch<double>& patch,
        const BulletOptions& options)
      : problem_(problem),
        patch_(patch),
        options_(options),
        dispatcher_(&configuration_),
        world_(&dispatcher_, &broadphase_, &solver_, &configuration_) {
    world_.setGravity({problem.gravity.x, problem.gravity.z, 0});
    auto& info = world_.getSolverInfo();
    info.m_numIterations = options.iterations;
    info.m_solverMode = SOLVER_USE_WARMSTARTING | SOLVER_SIMD;
    if (options.friction != BulletFriction::along) info.m_solverMode |= SOLVER_USE_2_FRICTION_DIRECTIONS;
    if (options.friction == BulletFriction::fixed)
      info.m_solverMode |=
          SOLVER_DISABLE_VELOCITY_DEPENDENT_FRICTION_DIRECTION | SOLVER_ENABLE_FRICTION_DIRECTION_CACHING;
    add_object();
    add_pads();
  }
  ~World() {
    world_.removeRigidBody(object_.get());
    for (auto& pad : pads_) world_.removeRigidBody(pad.body.get());
  }

  void step(double from, double to) {
    const dynamics::Window window{from, to};
    const auto before = problem_.hand.at(window, from), after = problem_.hand.at(window, to);
    const double h = to - from, normal = problem_.normal_force.at(window, to);
    for (auto& pad : pads_) {
      const auto a = place(before.pose, pad.position), b = place(after.pose, pad.position);
      const double pressing = pad.body->getLinearVelocity().z();
      pad.body->setLinearVelocity({(b.x - a.x) / h, (b.z - a.z) / h, pressing});
      pad.body->setAngularVelocity({0, 0, (after.pose.theta - before.pose.theta) / h});
      pad.body->applyCentralForce({0, 0, -pad.side * pad.share * normal});
    }
    world_.stepSimulation(h, 0);
    const double turned = object_->getAngularVelocity().z() * h;
    theta_ += turned;
  }

  BulletResult result(double t) const {
    const auto& where = object_->getCenterOfMassPosition();
    const auto& v = object_->getLinearVelocity();
    BulletResult out;
    out.detach = {t, {where.x(), where.y(), theta_}, {v.x(), v.y(), object_->getAngularVelocity().z()}};
    const auto hand =
        problem_.hand.at({problem_.start, t > problem_.start ? t : problem_.start + options_.step}, t);
    const dynamics::Vec2<double> r{out.detach.pose.x - hand.pose.x, out.detach.pose.z - hand.pose.z};
    const auto patch = dynamics::twist_at_patch(out.detach.twist, r);
    out.relative = {dynamics::rotate(-theta_, r),
                    theta_ - hand.pose.theta,
                    {patch.vx - hand.twist.vx, patch.vz - hand.twist.vz},
                    patch.omega - hand.twist.omega};
    return out;
  }

 private:
  static dynamics::Vec2<double> place(const dynamics::Pose<double>& hand, const dynamics::Vec2<double>& at) {
    const auto p = dynamics::rotate(hand.theta, at);
    return {hand.x + p.x, hand.z + p.z};
  }

  std::unique_ptr<btRigidBody> body(btCollisionShape& shape, double mass, double inertia,
                                    const btTransform& at) {
    auto out = std::make_unique<btRigidBody>(
        btRigidBody::btRigidBodyConstructionInfo(mass, nullptr, &shape, {inertia, inertia, inertia}));
    out->setWorldTransform(at);
    out->setInterpolationWorldTransform(at);
    out->setDamping(0, 0);
    out->setActivationState(DISABLE_DEACTIVATION);
    out->setRestitution(0);
    return out;
  }

  void add_object() {
    const auto hand = problem_.hand.at({problem_.start, problem_.start + options_.step}, problem_.start);
    theta_ = hand.pose.theta + problem_.grasp.angle;
    const auto r =
        dynamics::rotate(theta_, dynamics::Vec2<double>{problem_.grasp.com_offset, problem_.grasp.across});
    btTransform at(btQuaternion(btVector3(0, 0, 1), theta_), {hand.pose.x + r.x, hand.pose.z + r.z, 0});
    plate_.setMargin(1e-3);
    object_ = body(plate_, problem_.body.mass, problem_.body.inertia, at);
    object_->setLinearFactor({1, 1, 0});
    object_->setAngularFactor({0, 0, 1});
    object_->setFriction(1);
    const double omega = hand.twist.omega + problem_.spin;
    object_->setLinearVelocity(
        {hand.twist.vx + problem_.slip.x - omega * r.z, hand.twist.vz + problem_.slip.z + omega * r.x, 0});
    object_->setAngularVelocity({0, 0, omega});
    world_.addRigidBody(object_.get(), kObject, kPad);
  }

  void add_pads() {
    const auto hand = problem_.hand.at({problem_.start, problem_.start + options_.step}, problem_.start);
    std::vector<PatchPoint> points{{{0, 0}, 1.0}};
    double half = kPadHalf;
    if (options_.pads == BulletPads::pins) {
      // the radius whose pins have the patch's torque limit: c differs from that of a disc by the points'
      // number
      points = disc_points(options_.rings);
      double c = 0;
      for (const auto& [p, load] : points) c += load * norm(p);
      for (auto& [p, load] : points) p = (patch_.length() / c) * p;
    }
    if (options_.pads == BulletPads::cylinder) {
      face_ = std::make_unique<btCylinderShapeZ>(btVector3(patch_.radius, patch_.radius, kPadHalf));
      face_->setMargin(1e-4);
    }
    btCollisionShape& shape = face_ ? static_cast<btCollisionShape&>(*face_) : pin_;
    for (const double side : {1.0, -1.0})
      for (const auto& [p, load] : points) {
        Pad pad{nullptr, p, load, side};
        const auto where = place(hand.pose, p);
        const btTransform at(btQuaternion(btVector3(0, 0, 1), hand.pose.theta),
                             {where.x, where.z, side * (kHalfThickness + half)});
        // As heavy as the object: Bullet's rows take the whole mass of both, also along fixed directions, so
        // that any other ratio slows the iteration down.
        pad.body = body(shape, problem_.body.mass, 0, at);
        pad.body->setLinearFactor({0, 0, 1});
        pad.body->setAngularFactor({0, 0, 0});
        pad.body->setFriction(patch_.mu * patch_.pads / 2);
        if (options_.pads == BulletPads::point)
          pad.body->setSpinningFriction(patch_.mu * patch_.pads / 2 * patch_.length()),
              pad.body->setRollingFriction(1e-12);
        world_.addRigidBody(pad.body.get(), kPad, kObject);
        pads_.push_back(std::move(pad));
      }
  }

  const release::ReleaseProblem<double>& problem_;
  const contact::Patch<double>& patch_;
  const BulletOptions& options_;
  btDefaultCollisionConfiguration configuration_;
  btCollisionDispatcher dispatcher_;
  btDbvtBroadphase broadphase_;
  btSequentialImpulseConstraintSolver solver_;
  btDiscreteDynamicsWorld world_;
  btBoxShape plate_{btVector3(1, 1, kHalfThickness)};
  btSphereShape pin_{kPadHalf};
  std::unique_ptr<btCylinderShapeZ> face_;
  std::unique_ptr<btRigidBody> object_;
  std::vector<Pad> pads_;
  double theta_{};
};

}  // namespace

const char* to_string(BulletPads pads) {
  switch (pads) {
    case BulletPads::pins:
      return "pins";
    case BulletPads::point:
      return "point";
    case BulletPads::cylinder:
      return "cylinder";
  }
  return "?";
}

const char* to_string(BulletFriction friction) {
  switch (friction) {
    case BulletFriction::along:
      return "along";
    case BulletFriction::across:
      return "across";
    case BulletFriction::fixed:
      return "fixed";
  }
  return "?";
}

bool has_bullet() { return true; }

BulletResult simulate_in_bullet(const release::ReleaseProblem<double>& problem,
                                const contact::Patch<double>& patch, const BulletOptions& options) {
  release::validate(problem);
  validate(patch);
  if (!(options.step > 0 && options.step <= 1e-2))
    throw std::invalid_argument(fmt::format("Bullet: step = {} is not in (0, 1e-2] s", options.step));
  if (options.rings < 1 || options.rings > 10)
    throw std::invalid_argument(fmt::format("Bullet: rings = {} is not in [1, 10]", options.rings));
  if (options.iterations < 1 || options.iterations > 100000)
    throw std::invalid_argument(
        fmt::format("Bullet: iterations = {} is not in [1, 100000]", options.iterations));
  const double release = problem.normal_force.release_time();
  const bool parts = release <= problem.hand.end();
  const double end = parts ? release : problem.hand.end();
  World world(problem, patch, options);
  if (end <= problem.start) {  // free before it begins, as simulate_release has it
    BulletResult out = world.result(problem.start);
    out.outcome = release::ReleaseOutcome::detached;
    return out;
  }
  const int steps = std::max(1, static_cast<int>(std::ceil((end - problem.start) / options.step)));
  const double h = (end - problem.start) / steps;
  for (int k = 0; k < steps; ++k)
    world.step(problem.start + k * h, k + 1 == steps ? end : problem.start + (k + 1) * h);
  BulletResult out = world.result(end);
  out.steps = steps;
  out.outcome = parts ? release::ReleaseOutcome::detached : release::ReleaseOutcome::never_separated;
  return out;
}

}  // namespace unhand::crosscheck
