//! Judges images of networks by features, which a comparison pixel by pixel does not see.
//!
//! PSNR and SSIM are in `nirspi_recon::metrics`. Here are distances between *sets* of images
//! ([`frechet`]), on features of this crate's classifier ([`character`]).

pub mod character;
pub mod frechet;

pub use character::{CharacterJudge, Judged};
pub use frechet::{FrechetError, frechet_distance};
