! The steady flow as the paper poses it, on 0 <= z <= Z in place of the half-line; t = z/Z.
! u = (nu, T, q, velocity); par = (Q, h, M, fixed, multiple): Z = fixed + multiple*h.
! No heat leaves through the top; what is above it is lost.
subroutine func(ndim, u, icp, par, ijac, f, dfdu, dfdp)
  use closures
  implicit none
  integer, intent(in) :: ndim, icp(*), ijac
  double precision, intent(in) :: u(ndim), par(*)
  double precision, intent(out) :: f(ndim)
  double precision, intent(inout) :: dfdu(ndim, ndim), dfdp(ndim, *)
  type(coefficients) :: g
  double precision :: nu, t, q, g1_slope, root_t, t_z, nu_z, work
  nu = u(1); t = u(2); q = u(3)
  g = closure(nu)
  root_t = sqrt(max(t, 1d-12)) ! as above: a trial may be negative
  g1_slope = g%compressibility + nu*g%compressibility_slope
  ! q = -g3 sqrt(T) T' + g4 T**1.5 nu', with (g1 T)' = -nu
  t_z = -(q/root_t + g%g4*nu/g1_slope)/(g%g3 + g%g4*nu*g%compressibility/g1_slope)
  nu_z = -nu*(1d0 + g%compressibility*t_z)/(g1_slope*t)
  work = (slope*nu*g%compressibility)**2/g%g2
  f(1) = nu_z
  f(2) = t_z
  f(3) = (work - nu**2*g%dissipation)*t*root_t
  f(4) = slope*nu*g%compressibility/g%g2*root_t
  f = (par(4) + par(5)*par(2))*f
end subroutine

subroutine stpnt(ndim, u, par, t)
  use starting
  implicit none
  integer, intent(in) :: ndim
  double precision, intent(inout) :: u(ndim), par(*)
  double precision, intent(in) :: t
  call start_at(t, u, par)
end subroutine

subroutine bcnd(ndim, par, icp, nbc, u0, u1, fb, ijac, dbc)
  use closures
  implicit none
  integer, intent(in) :: ndim, icp(*), nbc, ijac
  double precision, intent(in) :: par(*), u0(ndim), u1(ndim)
  double precision, intent(out) :: fb(nbc)
  double precision, intent(inout) :: dbc(nbc, *)
  type(coefficients) :: g
  double precision :: slip, heat
  g = closure(u0(1))
  call base(u0(1), slip, heat)
  fb(1) = u0(3) - heat*u0(1)*g%compressibility*u0(2)**1.5d0
  fb(2) = u0(4) - slip*sqrt(u0(2))
  fb(3) = u1(3)
end subroutine

subroutine icnd(ndim, par, icp, nint, u, uold, udot, upold, fi, ijac, dint)
  use closures
  implicit none
  integer, intent(in) :: ndim, icp(*), nint, ijac
  double precision, intent(in) :: par(*), u(ndim), uold(ndim), udot(ndim), upold(ndim)
  double precision, intent(out) :: fi(nint)
  double precision, intent(inout) :: dint(nint, *)
  type(coefficients) :: g
  double precision :: z_top
  g = closure(u(1))
  z_top = par(4) + par(5)*par(2)
  fi(1) = z_top*u(1)*u(4) - par(1)
  ! the moment of the mass is the integral of the normal stress
  fi(2) = z_top*u(1)*g%compressibility*u(2) - par(2)*par(3)
  fi(3) = z_top*u(1) - par(3)
end subroutine

subroutine fopt
end subroutine

subroutine pvls
end subroutine
