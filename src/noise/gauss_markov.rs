//! gauss_markov
