//! How good images are that a network made: what no comparison pixel by pixel sees.
//!
//! PSNR and SSIM are in `nirspi_recon::metrics`. Here are distances between *sets* of images ([`frechet`]), on features
//! of our own classifier ([`character`]) or of the user's [`inception`]. The law: a name says what was measured. FID is
//! what Inception's published weights give and nothing else.

pub mod character;
pub mod frechet;
pub mod inception;

pub use character::{CharacterJudge, Judged};
pub use frechet::{FrechetError, frechet_distance};
pub use inception::Inception;
