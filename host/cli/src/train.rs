//! `nirspi train`: trains networks from a user's own characters, or makes pairs for training with
//! other programs.

mod data;
mod degrade;
mod network;
#[cfg(feature = "train")]
mod run;

use anyhow::Result;
use clap::Subcommand;
#[cfg(feature = "train")]
use nirspi_nets::train::Model;
use std::process::ExitCode;

/// Train the networks on your own characters, on the CPU or a GPU (builds with the feature `train`)
///
/// Every few hundred steps the run is saved in its folder: checkpoint.bin to go on from (--resume), the best weights in
/// weights.safetensors, log.jsonl and plot.png. Ctrl-C keeps it too.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi train fsrcnn --data chars74k/ --out run/fsrcnn\n\
    \x20 nirspi train diffusion --data chars74k/ --fsrcnn run/fsrcnn/weights.safetensors --out run/diffusion\n\
    \x20 nirspi train diffusion --data chars74k/ --out run/diffusion --resume")]
pub struct TrainArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// 32 x 32 and depth to 64 x 64, denoised
    #[command(after_help = "Example:\n  nirspi train fsrcnn --data chars74k/ --out run/fsrcnn")]
    Fsrcnn(network::Args),
    /// The deblurrer: 1 to 4 steps on a bridge from the degraded image
    #[command(
        after_help = "Example:\n  nirspi train diffusion --data chars74k/ --out run/diffusion"
    )]
    Diffusion(network::Args),
    /// The paper's diffusion of 500 steps, the baseline
    #[command(
        after_help = "Example:\n  nirspi train ancestral --data chars74k/ --out run/ancestral"
    )]
    Ancestral(network::Args),
    /// The generator of a conditional GAN, the other baseline
    #[command(after_help = "Example:\n  nirspi train gan --data chars74k/ --out run/gan")]
    Gan(network::Args),
    /// Blur and noise of an image, from the image
    #[command(
        after_help = "Example:\n  nirspi train estimator --data chars74k/ --out run/estimator"
    )]
    Estimator(network::Args),
    /// The 62 characters: for accuracy and the Frechet character distance
    #[command(
        after_help = "Example:\n  nirspi train classifier --data chars74k/ --out run/classifier"
    )]
    Classifier(network::Args),
    Degrade(degrade::Args),
}

pub fn run(args: &TrainArgs) -> Result<ExitCode> {
    match &args.what {
        What::Degrade(args) => degrade::run(args),
        #[cfg(feature = "train")]
        What::Fsrcnn(args) => run::run(args, Model::Fsrcnn),
        #[cfg(feature = "train")]
        What::Diffusion(args) => run::run(args, Model::Diffusion),
        #[cfg(feature = "train")]
        What::Ancestral(args) => run::run(args, Model::Ancestral),
        #[cfg(feature = "train")]
        What::Gan(args) => run::run(args, Model::Gan),
        #[cfg(feature = "train")]
        What::Estimator(args) => run::run(args, Model::Estimator),
        #[cfg(feature = "train")]
        What::Classifier(args) => run::run(args, Model::Classifier),
        #[cfg(not(feature = "train"))]
        _ => anyhow::bail!(
            "this build has no training; build it with: cargo build --release --features train"
        ),
    }
}
