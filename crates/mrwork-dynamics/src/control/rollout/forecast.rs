//! Forecast of the ground acceleration: an autoregressive model that recursive least squares fit while the motion goes on.

use crate::control::measurement::Preview;
use crate::lanes::Lanes;
use crate::real::within;

/// Trace of the covariance, over its first value, beyond which nothing is forgotten: a still ground teaches nothing.
const MOST_GROWTH: f64 = 1e6;

/// `a(k+1) = sum_m w_m a(k+1-m)`, m from 1 to the order.
pub(super) struct Forecast<R> {
    pub(super) order: usize,
    pub(super) forgetting: f64,
    /// Trace beyond which nothing is forgotten.
    pub(super) largest_trace: f64,
    /// Last readings, newest first.
    readings: Vec<R>,
    weights: Vec<R>,
    /// Covariance of the weights over the variance of the noise, shape (order, order).
    covariance: Vec<R>,
    spread: Vec<R>,
    /// Readings with those that are forecast before them, during a forecast.
    window: Vec<R>,
    /// The present acceleration and those that are forecast, an interval apart.
    pub(super) nodes: Vec<R>,
}

impl<R: Lanes> Forecast<R> {
    /// Without readings; of order zero it forecasts a still ground.
    #[allow(clippy::cast_precision_loss)] // few weights
    pub(super) fn new(order: usize, forgetting: f64, covariance: f64, n_nodes: usize) -> Self {
        let zero = R::splat(0.0);
        let mut matrix = vec![zero; order * order];
        for weight in 0..order {
            matrix[weight * (order + 1)] = R::splat(covariance);
        }
        Self {
            order,
            forgetting,
            largest_trace: MOST_GROWTH * covariance * order as f64,
            readings: vec![zero; order],
            weights: vec![zero; order],
            covariance: matrix,
            spread: vec![zero; order],
            window: vec![zero; order],
            nodes: vec![zero; n_nodes],
        }
    }

    /// Whether the ground acceleration is measured.
    #[inline(always)]
    pub(super) fn measures(&self) -> bool {
        self.order > 0
    }

    /// Learns from a reading; one that is not a number counts as forecast.
    #[inline(always)]
    pub(super) fn learn(&mut self, reading: R, limit: R) {
        let Self { order, readings, weights, covariance, spread, .. } = self;
        let order = *order;
        if order == 0 {
            return;
        }
        let expected = within(product(weights, readings), -limit, limit);
        let reading = R::select(reading.equal(reading), reading, expected);
        let error = reading - product(weights, readings);
        for (row, spread) in spread.iter_mut().enumerate() {
            *spread = product(&covariance[row * order..][..order], readings);
        }
        let inverse = R::splat(1.0) / (product(spread, readings) + R::splat(self.forgetting));
        let mut trace = R::splat(0.0);
        for row in 0..order {
            trace = trace + covariance[row * (order + 1)];
        }
        let grows = trace.less(R::splat(self.largest_trace));
        let growth = R::select(grows, R::splat(1.0 / self.forgetting), R::splat(1.0));
        for row in 0..order {
            let gain = spread[row] * inverse;
            weights[row] = gain.mul_add(error, weights[row]);
            for column in row..order {
                let next = (-gain).mul_add(spread[column], covariance[row * order + column]) * growth;
                covariance[row * order + column] = next;
                covariance[column * order + row] = next;
            }
        }
        for place in (1..order).rev() {
            readings[place] = readings[place - 1];
        }
        readings[0] = reading;
    }

    /// Fills the nodes, `interval` apart: as they are where the preview reaches, else forecast within the limit.
    #[inline(always)]
    #[allow(clippy::cast_precision_loss)] // a few nodes
    pub(super) fn predict(&mut self, limit: R, interval: f64, preview: &Preview<'_>) {
        let Self { order, readings, weights, window, nodes, .. } = self;
        if *order == 0 {
            return;
        }
        window.copy_from_slice(readings);
        for (number, node) in nodes.iter_mut().enumerate() {
            if number > 0 {
                let ahead = interval * number as f64;
                let next = if preview.reaches(ahead) {
                    preview.acceleration(ahead)
                } else {
                    within(product(weights, window), -limit, limit)
                };
                for place in (1..*order).rev() {
                    window[place] = window[place - 1];
                }
                window[0] = next;
            }
            *node = window[0];
        }
    }

    /// Acceleration at a time after the present one, in intervals: straight between the nodes.
    #[inline(always)]
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_precision_loss)] // a few nodes
    pub(super) fn at(&self, intervals: f64) -> R {
        let last = self.nodes.len() - 1;
        let before = (intervals.floor() as usize).min(last);
        let after = (before + 1).min(last);
        let share = R::splat(intervals - before as f64);
        (self.nodes[after] - self.nodes[before]).mul_add(share, self.nodes[before])
    }
}

#[inline(always)]
fn product<R: Lanes>(left: &[R], right: &[R]) -> R {
    let mut sum = R::splat(0.0);
    for (&one, &other) in left.iter().zip(right) {
        sum = one.mul_add(other, sum);
    }
    sum
}
