// The definitions of ContactModelFrom: included by the source of a contact model, and by nothing else.
#pragma once

#include "contact/contact_model.hpp"

namespace unhand::contact {

template <class Model>
Wrench<double> ContactModelFrom<Model>::wrench(int m, const Scene<double>& s,
                                               const Relative<double>& y) const {
  return static_cast<const Model&>(*this).wrench_(m, s, y);
}
template <class Model>
Wrench<Dual> ContactModelFrom<Model>::wrench(int m, const Scene<Dual>& s, const Relative<Dual>& y) const {
  return static_cast<const Model&>(*this).wrench_(m, s, y);
}
template <class Model>
void ContactModelFrom<Model>::rate(int m, const Scene<double>& s, const Relative<double>& y,
                                   State<double, 6>& dy) const {
  static_cast<const Model&>(*this).rate_(m, s, y, dy);
}
template <class Model>
void ContactModelFrom<Model>::rate(int m, const Scene<Dual>& s, const Relative<Dual>& y,
                                   State<Dual, 6>& dy) const {
  static_cast<const Model&>(*this).rate_(m, s, y, dy);
}
template <class Model>
void ContactModelFrom<Model>::guards(const Phase& p, const SceneSource& w, double t,
                                     const Relative<double>& y, double* g) const {
  static_cast<const Model&>(*this).guards_(p, w, t, y, g);
}
template <class Model>
void ContactModelFrom<Model>::guards(const Phase& p, const SceneSource& w, const Dual& t,
                                     const Relative<Dual>& y, Dual* g) const {
  static_cast<const Model&>(*this).guards_(p, w, t, y, g);
}
template <class Model>
Entry<double, 6> ContactModelFrom<Model>::on_guard(const Phase& p, int i, const SceneSource& w, double t,
                                                   const Relative<double>& y) const {
  return static_cast<const Model&>(*this).on_guard_(p, i, w, t, y);
}
template <class Model>
Entry<Dual, 6> ContactModelFrom<Model>::on_guard(const Phase& p, int i, const SceneSource& w, const Dual& t,
                                                 const Relative<Dual>& y) const {
  return static_cast<const Model&>(*this).on_guard_(p, i, w, t, y);
}
template <class Model>
Entry<double, 6> ContactModelFrom<Model>::membership(int m, const Window& v, const SceneSource& w, double t,
                                                     const Relative<double>& y) const {
  return static_cast<const Model&>(*this).membership_(m, v, w, t, y);
}
template <class Model>
Entry<Dual, 6> ContactModelFrom<Model>::membership(int m, const Window& v, const SceneSource& w,
                                                   const Dual& t, const Relative<Dual>& y) const {
  return static_cast<const Model&>(*this).membership_(m, v, w, t, y);
}

}  // namespace unhand::contact
