//! The seed paper's recipe, step by step, with what each step costs.

use schemars::JsonSchema;
use serde::Serialize;

#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Step {
    /// "N on the -1/2 line at tau = 1 s"
    pub what: String,
    pub formula: String,
    pub value: f64,
    pub unit: String,
    /// What the recipe costs here, in a sentence.
    pub cost: String,
}
