//! End-to-end tests, and checks of the project's own rules.

mod boards;
mod book;
mod budgets;
mod citation;
mod dependencies;
mod end_to_end;
mod faults;
mod mutated_files;
mod page_figures;
mod qemu;
mod quality_page;
mod register_table;
mod safety;
mod safety_page;
mod security_page;
mod throughput;
mod web_usb;
mod words;
