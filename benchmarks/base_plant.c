/* The base physics of the plant written by hand, as a peer for the compiled composition (see plant_speed.py).
 * States: position, velocity, pressure A, pressure B, spool lift, lift rate. Four lands, two chambers, RK4. */
#include <math.h>

typedef struct {
    double mass, area, stroke, dead, beta, ps, pt, land, leak, transition, viscous, leakage, w, zeta, stop_k, stop_c, limit;
} plant;

static inline double flow(double gain, double opening, double drop, double transition)
{
    return gain * opening * drop / sqrt(fabs(drop) + transition);
}

static inline void rhs(const plant *p, const double *s, double command, double *d)
{
    double x = s[0], v = s[1], pa = s[2], pb = s[3], o = s[4];
    double plus = fmax(o, 0.0) + p->leak, minus = fmax(-o, 0.0) + p->leak;
    double leak = p->leakage * (pa - pb);
    double qa = flow(p->land, plus, p->ps - pa, p->transition) - flow(p->land, minus, pa - p->pt, p->transition) - leak;
    double qb = flow(p->land, minus, p->ps - pb, p->transition) - flow(p->land, plus, pb - p->pt, p->transition) + leak;
    double va = fmax(p->dead + p->area * (0.5 * p->stroke + x), 0.01 * p->dead);
    double vb = fmax(p->dead + p->area * (0.5 * p->stroke - x), 0.01 * p->dead);
    double force = -p->viscous * v, depth = fabs(x) - 0.5 * p->stroke;
    if (depth > 0.0) {
        double side = x > 0.0 ? 1.0 : -1.0;
        force -= side * fmax(p->stop_k * depth + p->stop_c * fmin(depth / 1e-5, 1.0) * side * v, 0.0);
    }
    d[0] = v;
    d[1] = ((pa - pb) * p->area + force) / p->mass;
    d[2] = (qa - p->area * v) * p->beta / va;
    d[3] = (qb + p->area * v) * p->beta / vb;
    d[4] = s[5];
    d[5] = p->w * p->w * (command - o) - 2.0 * p->zeta * p->w * s[5];
}

void run(const double *drive, long n, double dt, long substeps, const double *v, double *x, double *out)
{
    plant p = {v[0], v[1], v[2], v[3], v[4], v[5], v[6], v[7] / sqrt(v[8]), v[9], v[10], v[11], v[12],
               6.283185307179586 * v[13], v[14], v[15], v[16], v[17]};
    double h = dt / substeps, k[6], sum[6], s[6];
    for (long i = 0; i < n; i++) {
        double command = fmin(fmax(drive[i] / p.limit, -1.0), 1.0);
        for (int j = 0; j < 6; j++) out[6 * i + j] = x[j];
        for (long m = 0; m < substeps; m++) {
            rhs(&p, x, command, k);
            for (int j = 0; j < 6; j++) { sum[j] = k[j]; s[j] = x[j] + 0.5 * h * k[j]; }
            rhs(&p, s, command, k);
            for (int j = 0; j < 6; j++) { sum[j] += 2.0 * k[j]; s[j] = x[j] + 0.5 * h * k[j]; }
            rhs(&p, s, command, k);
            for (int j = 0; j < 6; j++) { sum[j] += 2.0 * k[j]; s[j] = x[j] + h * k[j]; }
            rhs(&p, s, command, k);
            for (int j = 0; j < 6; j++) x[j] += h / 6.0 * (sum[j] + k[j]);
        }
    }
}
