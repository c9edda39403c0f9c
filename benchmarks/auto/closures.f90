! The laws of table 1 and the base, (3.16) and (3.18), as printed but for factors of nu that cancel.
! nu volume fraction, e restitution, s slope; misprints mended as in the docs.
module closures
  implicit none
  double precision, parameter :: pi = 3.14159265358979323846d0, densest = 0.62d0
  double precision, parameter :: slope = 0.3d0, e = 0.8d0, wall_e = 0.8d0, roughness = 0.6d0
  type coefficients
    double precision :: g0, compressibility, compressibility_slope, g2, g3, g4, dissipation
  end type
contains
  type(coefficients) function closure(nu)
    ! compressibility is g1/nu, and dissipation g5/nu**2
    double precision, intent(in) :: nu
    double precision :: g0, gap, rise, x, f, root_pi
    root_pi = sqrt(pi)
    f = 1d0 + e
    gap = max(1d0 - nu/densest, 1d-6) ! finite for a trial beyond the densest packing, so that a step can be refused
    g0 = gap**(-2.5d0*densest)
    rise = 2.5d0/gap
    x = nu*g0
    closure%g0 = g0
    closure%compressibility = 1d0 + 2d0*f*x
    closure%compressibility_slope = 2d0*f*g0*(1d0 + nu*rise)
    closure%g2 = root_pi*(5d0 + 4d0*f*x)*(5d0 + 2d0*f*(3d0*e - 1d0)*x)/(120d0*(3d0 - e)*f*g0) &
      + 4d0/(5d0*root_pi)*f*nu*x
    closure%g3 = root_pi*(5d0 + 6d0*f*x)*(5d0 + 3d0*f**2*(2d0*e - 1d0)*x)/(4d0*f*(49d0 - 33d0*e)*g0) &
      + 2d0/root_pi*f*nu*x
    closure%g4 = 3d0*root_pi*(5d0 + 6d0*f*x)/(4d0*(49d0 - 33d0*e))*e*(1d0 - e)*(2d0 + nu*rise)
    closure%dissipation = 12d0/root_pi*(1d0 - e**2)*g0
  end function

  subroutine base(nu, slip, heat)
    ! slip = u/sqrt(T) and heat = q/(p sqrt(T)) at the base
    double precision, intent(in) :: nu
    double precision, intent(out) :: slip, heat
    type(coefficients) :: g
    double precision :: lid, kappa, bumps, contact
    g = closure(nu)
    lid = sqrt(1d0 - roughness**2)
    kappa = 2d0/3d0*(2d0/(1d0 + lid) - lid)
    contact = pi/(12d0*sqrt(2d0))
    bumps = nu*(1d0 + contact) + contact*5d0/(8d0*g%g0)
    slip = slope/kappa*(sqrt(pi/2d0) + (kappa*nu - 0.5d0*roughness**2*bumps)*g%compressibility/g%g2)
    heat = slope*slip - sqrt(2d0/pi)*2d0*(1d0 - wall_e)/(1d0 + lid)
  end subroutine
end module
