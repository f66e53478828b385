/* Forces of linear springs, one after the other, on nodes displaced by u.

   The measure for the compiled Python: the same arrays in the same order, and what a C compiler
   makes of them without -ffast-math. Springs: ends (s, 2), rest vector [m] (s, 3), rest length [m]
   and weight times rest length [m] (s,), k [N/m]. Nodes: u [m] and force [N], each (n, 3). */

#include <math.h>
#include <stdint.h>

void add_spring_forces(int64_t springs, double k, const int32_t *restrict ends,
                       const double *restrict rest, const double *restrict rest_length,
                       const double *restrict scale, const double *restrict u,
                       double *restrict force)
{
    for (int64_t s = 0; s < springs; s++) {
        const double *from = u + 3 * (int64_t)ends[2 * s];
        const double *to = u + 3 * (int64_t)ends[2 * s + 1];
        double *on = force + 3 * (int64_t)ends[2 * s];
        double *against = force + 3 * (int64_t)ends[2 * s + 1];
        double dx = rest[3 * s] + to[0] - from[0];
        double dy = rest[3 * s + 1] + to[1] - from[1];
        double dz = rest[3 * s + 2] + to[2] - from[2];
        double length = sqrt(dx * dx + dy * dy + dz * dz);
        double strain = (length - rest_length[s]) / rest_length[s];
        double pull = scale[s] * (k * strain) / length;
        on[0] += pull * dx;
        on[1] += pull * dy;
        on[2] += pull * dz;
        against[0] -= pull * dx;
        against[1] -= pull * dy;
        against[2] -= pull * dz;
    }
}
