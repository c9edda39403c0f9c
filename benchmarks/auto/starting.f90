! The flow from which a curve starts: a table in start.dat, read once and interpolated linearly.
module starting
  implicit none
  double precision, allocatable :: t_table(:), u_table(:,:), parameters(:)
contains
  subroutine read_table()
    integer :: points, fields, count, i
    open (unit=77, file='start.dat', status='old')
    read (77, *) points, fields, count
    allocate (t_table(points), u_table(fields, points), parameters(count))
    read (77, *) parameters
    do i = 1, points
      read (77, *) t_table(i), u_table(:, i)
    end do
    close (77)
  end subroutine

  subroutine start_at(t, u, par)
    double precision, intent(in) :: t
    double precision, intent(inout) :: u(*), par(*)
    integer :: i, n
    double precision :: share
    if (.not. allocated(t_table)) call read_table()
    n = size(u_table, 1)
    i = min(max(count(t_table <= t), 1), size(t_table) - 1)
    share = (t - t_table(i))/(t_table(i + 1) - t_table(i))
    u(1:n) = (1d0 - share)*u_table(:, i) + share*u_table(:, i + 1)
    par(1:size(parameters)) = parameters
  end subroutine
end module
