//! The arguments of `nirspi train NETWORK`.

use super::data::DataArgs;
use crate::camera::ModelArgs;
use crate::report::ReportArgs;
use nirspi_nets::device::Backend;
use std::path::PathBuf;

/// Everything but which network.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    pub data: DataArgs,
    /// Folder for checkpoint, weights, log and plot
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Steps in all [default: fsrcnn 8000, diffusion and ancestral 20000, gan 12000, others 6000]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub steps: Option<u64>,
    /// Examples in each step
    #[arg(long, value_name = "N", default_value_t = 16)]
    pub batch: usize,
    /// Highest learning rate [default: fsrcnn 0.002, ancestral and gan 0.0005, others 0.001]
    #[arg(long, value_name = "R")]
    pub rate: Option<f64>,
    /// Seed of weights, split and examples
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Channels of each level, as 32,64,128 [default: the shipped size]
    #[arg(long, value_name = "C,C,...", value_delimiter = ',')]
    pub width: Vec<usize>,
    #[command(flatten)]
    pub model: ModelArgs,
    /// Share of the examples that the virtual camera makes; the others are made by formulas
    #[arg(long, value_name = "0..1", default_value_t = 0.2)]
    pub camera_share: f32,
    /// Weights of the FSRCNN that comes before the deblurrer [default: the ones in this program]
    #[arg(long, value_name = "FILE")]
    pub fsrcnn: Option<PathBuf>,
    /// Steps from one test on held-out examples to the next, and from one checkpoint to the next
    #[arg(long, value_name = "N", default_value_t = 500,
          value_parser = clap::value_parser!(u64).range(1..))]
    pub judge_every: u64,
    /// Number of tests without a better score after which training ends; 0 trains to the last step
    #[arg(long, value_name = "N", default_value_t = 12)]
    pub patience: u64,
    /// Continue from the checkpoint in the folder
    #[arg(long)]
    pub resume: bool,
    /// Where the network learns: auto (a real GPU if there is one), cpu, wgpu or cuda
    #[arg(long, value_name = "BACKEND", default_value_t)]
    pub backend: Backend,
    #[command(flatten)]
    pub report: ReportArgs,
}
