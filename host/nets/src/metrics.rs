//! How good images are that a network made: what no comparison pixel by pixel sees.
//!
//! PSNR and SSIM are in `nirspi_recon::metrics`. Here are distances between *sets* of images ([`frechet`]), on features
//! of our own classifier ([`character`]) or of the user's [`inception`].
//!
//! A name says what was measured: FID is what Inception's published weights give and nothing else. Inception runs in builds
//! with the feature `train`; without it, [`Inception::new`] says which build has FID.

pub mod character;
pub mod frechet;
#[cfg(feature = "train")]
pub mod inception;
#[cfg(not(feature = "train"))]
#[doc(hidden)]
pub mod no_inception;

pub use character::{CharacterJudge, Judged};
pub use frechet::{FrechetError, frechet_distance};
pub use inception::Inception;
#[cfg(not(feature = "train"))]
pub use no_inception as inception;
