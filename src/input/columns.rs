//! Column names and header units to axes.
