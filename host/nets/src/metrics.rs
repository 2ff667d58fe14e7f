//! Judges images of networks by features, which a comparison pixel by pixel does not see.
//!
//! PSNR and SSIM are in `nirspi_recon::metrics`. Here are distances between *sets* of images
//! ([`frechet`]), on features of this crate's classifier ([`character`]) or of the user's
//! [`inception`].
//!
//! Only a distance on features of Inception's published weights is called FID. Inception runs in
//! builds with the feature `train`; without it, [`Inception::new`] says which build has FID.

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
