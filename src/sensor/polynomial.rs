//! Real roots of polynomials. They show where the model of a lens folds.

/// The value at `x` of the polynomial c0 + c1·x + c2·x² + … with these `coefficients`.
pub(super) fn value(coefficients: &[f64], x: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, c| sum * x + c)
}

/// The coefficients of the derivative of a polynomial.
pub(super) fn derivative(coefficients: &[f64]) -> Vec<f64> {
    coefficients.iter().enumerate().skip(1).map(|(power, c)| power as f64 * c).collect()
}

/// The coefficients of the product of two polynomials.
pub(super) fn product(a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut c = vec![0.0; a.len() + b.len() - 1];
    for (i, x) in a.iter().enumerate() {
        for (j, y) in b.iter().enumerate() {
            c[i + j] += x * y;
        }
    }
    c
}

/// The numbers in (`low`, `high`) at which a polynomial changes its sign, in ascending order.
///
/// Between neighbouring roots of its derivative a polynomial is monotonic and so has at most one root, which bisection
/// finds to the last bit. The roots of the derivative are found in the same way.
pub(super) fn sign_changes(coefficients: &[f64], low: f64, high: f64) -> Vec<f64> {
    if coefficients.len() < 2 {
        return Vec::new();
    }
    let mut cuts = vec![low];
    cuts.extend(sign_changes(&derivative(coefficients), low, high));
    cuts.push(high);
    let is_negative = |x: f64| value(coefficients, x) < 0.0;
    cuts.windows(2)
        .filter(|cut| is_negative(cut[0]) != is_negative(cut[1]))
        .map(|cut| bisect(cut[0], cut[1], |x| is_negative(x) == is_negative(cut[0])))
        .collect()
}

/// The last number in [`low`, `high`] at which `holds` is true, if it is true from `low` up to some number and false
/// beyond.
pub(super) fn bisect(mut low: f64, mut high: f64, holds: impl Fn(f64) -> bool) -> f64 {
    loop {
        let middle = low + (high - low) / 2.0;
        if middle <= low || middle >= high {
            return low;
        }
        if holds(middle) { low = middle } else { high = middle }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_simple_root_is_found() {
        // (x − 1)(x − 2)(x − 5)
        let cubic = product(&product(&[-1.0, 1.0], &[-2.0, 1.0]), &[-5.0, 1.0]);
        assert_eq!(cubic, [-10.0, 17.0, -8.0, 1.0]);
        let roots = sign_changes(&cubic, 0.0, 10.0);
        assert_eq!(roots.len(), 3);
        assert!(roots.iter().zip([1.0, 2.0, 5.0]).all(|(a, b)| (a - b).abs() < 1e-14), "{roots:?}");
        assert_eq!(sign_changes(&cubic, 1.5, 4.0).len(), 1);
        // A double root is no change of sign, and a constant has no root.
        assert!(sign_changes(&[1.0, -2.0, 1.0], 0.0, 9.0).is_empty());
        assert!(sign_changes(&[3.0], 0.0, 9.0).is_empty());
        assert!(sign_changes(&[3.0, 0.0, 0.0], 0.0, 9.0).is_empty());
    }
}
