//! From measurements as they were read to images, pictures and reports in a folder: [`Pipeline`] for one measurement, all
//! measurements of a file or recording, or many files; [`own_image`] for patterns of a user's own.

mod for_networks;
mod frame_reports;
mod images;
mod many;
mod networks;
mod one;
mod own;
mod pipeline;
mod pipeline_error;
mod result_folder;
mod said;
mod solver;
mod stack;
mod watch;

pub use frame_reports::FrameReports;
pub use many::Skipped;
pub use networks::NetworksError;
pub use one::{DropoutReport, LampReport, OneReport};
pub use own::{
    OwnError, OwnFrames, OwnImage, OwnInput, OwnMade, OwnReport, matrix_doubts, matrix_warnings,
    own_image,
};
pub use pipeline::Pipeline;
pub use pipeline_error::PipelineError;
pub use result_folder::ResultFolder;
pub use said::{AllSaid, Kind, Said};
pub use solver::{
    Recipe, Solved, Solver, SolverError, check_finite, not_read_words, own_atoms, read_atoms,
};
pub use stack::StackReport;
pub use watch::{Step, Watch};

use many::FileImage;
use networks::Networks;
use one::write_image;
