#include "contact/limit_surface_from.hpp"

namespace unhand::contact {

template class ContactModelFrom<LimitSurface<Ellipsoid>>;
template class ContactModelFrom<LimitSurface<UniformDisc>>;
template class ContactModelFrom<LimitSurface<PressedDisc>>;
template class ContactModelFrom<LimitSurface<ConvexQuartic>>;
template class ContactModelFrom<LimitSurface<IsotropicQuartic>>;
template class LimitSurface<Ellipsoid>;
template class LimitSurface<UniformDisc>;
template class LimitSurface<PressedDisc>;
template class LimitSurface<ConvexQuartic>;
template class LimitSurface<IsotropicQuartic>;

}  // namespace unhand::contact
