/* Reference trajectories in 80-bit arithmetic, for scenes too long for decimals: see scenes.py beside this.

   Shares nothing with the integrators: a Taylor series of fixed order between turning points of the velocity, these
   found by bisection; linear motion by its closed form. */

#include <math.h>
#include <stddef.h>

#define ORDER 30
typedef long double real;

static real value(const real *c, real x) {
    real sum = 0;
    for (int k = ORDER; k >= 0; k--) sum = sum * x + c[k];
    return sum;
}

/* Numbers: w, gamma, drag, friction, cubic. */
static void closed(const double *n, real y0, real v0, real t, double *y, double *v) {
    real w = n[0], g = n[1], fall, c, s;
    if (g < w) {
        real d = sqrtl((w - g) * (w + g));
        fall = expl(-g * t), c = cosl(d * t), s = sinl(d * t) / d;
        *y = (double)(fall * (c * y0 + s * (v0 + g * y0)));
        *v = (double)(fall * (c * v0 - s * (w * w * y0 + g * v0)));
    } else if (g == w) {
        fall = expl(-g * t);
        *y = (double)(fall * (y0 + (v0 + g * y0) * t));
        *v = (double)(fall * (v0 - g * (v0 + g * y0) * t));
    } else {
        real k = sqrtl((g - w) * (g + w)), slow = -w * w / (g + k), fast = -(g + k);
        real q = (slow * y0 - v0) / (slow - fast), p = (v0 - fast * y0) / (slow - fast);
        real a = p * expl(slow * t), b = q * expl(fast * t);
        *y = (double)(a + b);
        *v = (double)(slow * a + fast * b);
    }
}

/* States at the rows' multiples of a spacing; returns the number of steps, negative where they ran out. */
long solve(const double *n, double start_y, double start_v, double spacing, const long *rows, size_t count, long most,
           double *ys, double *vs) {
    real w = n[0], g = n[1], b = n[2], f = n[3], cubic = n[4], y = start_y, v = start_v;
    if (b == 0 && f == 0 && cubic == 0) {
        for (size_t i = 0; i < count; i++) closed(n, y, v, (real)spacing * rows[i], ys + i, vs + i);
        return 0;
    }
    size_t row = 0;
    real since = 0; /* time since the last row's multiple that has been kept, in the real time of `base` */
    long base = 0;
    for (long step = 0; step < most; step++) {
        real pull = w * w * y + cubic * y * y * y;
        if (v == 0 && fabsl(pull) <= f) {
            for (; row < count; row++) ys[row] = (double)y, vs[row] = 0;
            return step;
        }
        real way = v > 0 ? 1 : v < 0 ? -1 : pull > 0 ? -1 : 1;
        real size = fmaxl(fabsl(y), fabsl(v) / w), hard = sqrtl(w * w + 3 * fmaxl(cubic, 0) * size * size);
        real unit = 1 / (hard + 2 * g + 2 * b * (fabsl(v) + hard * fabsl(y)));
        real a[ORDER + 1], c[ORDER + 1], q[ORDER + 1];
        a[0] = y, c[0] = v, q[0] = y * y;
        for (int k = 0; k < ORDER; k++) {
            real drag = 0, force = 0;
            for (int i = 0; i <= k; i++) drag += c[i] * c[k - i], force += q[i] * a[k - i];
            real change = -w * w * a[k] - 2 * g * c[k] - way * b * drag - cubic * force - (k == 0 ? way * f : 0);
            a[k + 1] = unit * c[k] / (k + 1);
            c[k + 1] = unit * change / (k + 1);
            q[k + 1] = 0;
            for (int i = 0; i <= k + 1; i++) q[k + 1] += a[i] * a[k + 1 - i];
        }
        real x = 1.0L, scale = fmaxl(size, fabsl(a[2]));
        for (int k = ORDER - 1; k <= ORDER; k++) {
            real last = fmaxl(fabsl(a[k]), fabsl(c[k]) * unit);
            if (last > 0) x = fminl(x, powl(1e-22L * scale / last, 1.0L / k));
        }
        int turned = value(c, x) * way <= 0;
        if (turned) {
            real low = 0, high = x;
            for (int i = 0; i < 90; i++) {
                real middle = 0.5L * (low + high);
                if (value(c, middle) * way > 0) low = middle; else high = middle;
            }
            x = high;
        }
        real h = x * unit;
        while (row < count && (real)spacing * (rows[row] - base) <= since + h) {
            real at = ((real)spacing * (rows[row] - base) - since) / unit;
            ys[row] = (double)value(a, at), vs[row] = (double)value(c, at);
            row++;
        }
        if (row == count) return step + 1;
        y = value(a, x), v = turned ? 0 : value(c, x);
        since += h;
        long passed = (long)floorl(since / (real)spacing);
        since -= (real)spacing * passed, base += passed;
    }
    return -1;
}
