//! Many simulated runs through a design (floor 5): the quick verification that tune makes; the full gate comes later.
