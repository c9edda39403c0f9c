! The same flow with the normal stress for coordinate: t = p/M, 0 <= t <= 1, nothing truncated.
! u = (ln(nu/p), q/(p sqrt(T)), t, flux above); par = (Q, h, M).
subroutine func(ndim, u, icp, par, ijac, f, dfdu, dfdp)
  use closures
  implicit none
  integer, intent(in) :: ndim, icp(*), ijac
  double precision, intent(in) :: u(ndim), par(*)
  double precision, intent(out) :: f(ndim)
  double precision, intent(inout) :: dfdu(ndim, ndim), dfdp(ndim, *)
  type(coefficients) :: g
  double precision :: nu, w, y, t, g1_slope, t_p, net
  w = exp(u(1)); y = u(2)
  nu = par(3)*u(3)*w
  g = closure(nu)
  g1_slope = g%compressibility + nu*g%compressibility_slope
  t = 1d0/(w*g%compressibility)
  t_p = (y/w + g%g4/g1_slope)/(g%g3 + g%g4*nu*g%compressibility/g1_slope)
  net = g%dissipation/g%compressibility - slope**2*g%compressibility/g%g2
  f(1) = -par(3)*w*(g%compressibility_slope + g%compressibility**2*t_p)/g1_slope
  f(2) = par(3)*(net - 0.5d0*y*t_p/t)
  if (u(3) /= 0d0) f(2) = f(2) - y/u(3)
  f(3) = 1d0
  f(4) = par(3)**2*u(3)*slope*g%compressibility/g%g2*sqrt(t)
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
  double precision :: nu, w, slip, heat
  w = exp(u1(1))
  nu = par(3)*w
  g = closure(nu)
  call base(nu, slip, heat)
  fb(1) = u0(2)
  fb(2) = u0(3)
  fb(3) = u0(4)
  fb(4) = u1(2) - heat
  fb(5) = u1(4) + slip*par(3)/sqrt(w*g%compressibility) - par(1)
end subroutine

subroutine icnd(ndim, par, icp, nint, u, uold, udot, upold, fi, ijac, dint)
  implicit none
  integer, intent(in) :: ndim, icp(*), nint, ijac
  double precision, intent(in) :: par(*), u(ndim), uold(ndim), udot(ndim), upold(ndim)
  double precision, intent(out) :: fi(nint)
  double precision, intent(inout) :: dint(nint, *)
  fi(1) = exp(-u(1)) - par(2)
end subroutine

subroutine fopt
end subroutine

subroutine pvls
end subroutine
