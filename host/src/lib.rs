//! nirspi: an open near-infrared single-pixel camera.
//!
//! Data flows one way: bytes -> frames -> measurements -> image -> picture.
//!
//! * [`link`] moves bytes, [`session`] talks to a camera, [`account`] counts what became of every frame,
//! * [`versions`] says whether camera and program belong together, [`events`] what a camera reports unasked,
//! * [`gateware`] loads a camera's FPGA,
//! * [`calibration`] measures latency and settling, keeps and chooses them, [`selftest`] checks a camera,
//! * [`capture`] runs a measurement, [`recording`] keeps it,
//! * [`tally`] and [`integrate`] turn frames into measurements; `nirspi-recon` turns those into an image,
//! * [`source`] reads measurements from a file, a recording or a capture,
//! * [`files`], [`picture`] and [`scene`] are what people see and hand over, [`resolution`] says how fine it is,
//!   [`legibility`] whether somebody can read it,
//! * [`imaging`] scales, enhances and judges images, and says when not to trust them,
//! * [`serve`] shows a camera live on a web page,
//! * [`causes`] tells an error with its causes,
//! * [`training`] makes pairs to train networks on, through the virtual camera,
//! * [`udev`] lets users use cameras on USB; [`boards`] lists the boards that firmware is for; with the feature `flash`, `flash` programs them,
//! * [`example`] makes measurements to try the program on,
//! * [`virtual_camera`] is a camera without silicon: optics simulator, gateware model, real firmware logic.
//!
//! Without its features (`default-features = false`) the library captures, records, calibrates and reads measurements, and
//! builds neither web server nor typefaces, optics nor networks. The features `enhance`, `pictures`, `virtual-camera`, `serve`
//! and `training` add the rest, `gpu` the kernels for GPUs.

pub mod account;
pub mod boards;
pub mod calibration;
pub mod capture;
pub mod causes;
pub mod events;
#[cfg(feature = "virtual-camera")]
pub mod example;
pub mod files;
#[cfg(feature = "flash")]
pub mod flash;
pub mod gateware;
pub mod imaging;
pub mod integrate;
#[cfg(feature = "training")]
pub mod legibility;
pub mod link;
#[cfg(feature = "pictures")]
pub mod picture;
pub mod recording;
pub mod resolution;
#[cfg(feature = "pictures")]
pub mod scene;
pub mod selftest;
#[cfg(feature = "serve")]
pub mod serve;
pub mod session;
pub mod setup;
pub mod source;
pub mod tally;
#[cfg(feature = "training")]
pub mod training;
pub mod udev;
pub mod versions;
#[cfg(feature = "virtual-camera")]
pub mod virtual_camera;
#[cfg(feature = "virtual-camera")]
pub mod weather;
