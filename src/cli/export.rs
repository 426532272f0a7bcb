//! `kfdesign export`.

use std::io::Write;
use std::path::Path;

use anyhow::Context;

use super::Status;
use super::files::{self, Kind};
use super::output::{print_report, print_text, with_flags};
use crate::export::atomic::{self, AtomicFile};
use crate::ops::export::{Done, File, Request, run as export};
use crate::view;

/// Noise parameters in the files and units of other programs; a filter as source code in C or Rust
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples: kfdesign export params.json --to kalibr --accelerometer accelerometer.json --inflate 10 -o \
                  imu.yaml\n          kfdesign export filter.json --to c --precision float -o drift.c"
)]
pub struct Args {
    #[command(flatten)]
    request: Request,
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    let request = &args.request;
    files::check(&[("-o", &request.output, Kind::Other)], &request.inputs())?;
    let Done { files, self_test } = export(request)?;
    // the words of a file of parameters name options
    let text = |file: &File| if request.to.is_code() { file.text.clone() } else { with_flags(&file.text).into_owned() };
    let places: Option<Vec<&Path>> = files.iter().map(|file| file.path.as_deref()).collect();
    match places {
        Some(places) => {
            let mut open = Vec::new();
            for (file, place) in files.iter().zip(&places) {
                request.inputs().iter().try_for_each(|input| atomic::refuse_input_as_output(place, input))?;
                let mut output = AtomicFile::create(place)?;
                output.write_all(text(file).as_bytes()).with_context(|| place.display().to_string())?;
                open.push(output);
            }
            // all of them or, when one cannot be made, none
            open.into_iter().try_for_each(AtomicFile::commit)?;
            let names: Vec<String> = places.iter().map(|place| place.display().to_string()).collect();
            print_report(&view::export::export(&names, self_test), Status::Done);
        }
        None => files.iter().for_each(|file| print_text(&text(file))),
    }
    Ok(Status::Done)
}
