//! Linear maps of square images that act alike on rows and on columns, as products of matrices.

use crate::cosine::product;

/// The map from X to M X M^T.
#[derive(Debug)]
pub(crate) struct Separable {
    rows: usize,
    columns: usize,
    matrix: Vec<f32>,
    transposed: Vec<f32>,
}

impl Separable {
    /// The map of a matrix with `columns` columns, row after row.
    pub(crate) fn new(matrix: Vec<f32>, columns: usize) -> Self {
        let rows = matrix.len() / columns;
        let column = |c: usize| matrix[c..].iter().step_by(columns).copied();
        let transposed = (0..columns).flat_map(column).collect();
        Self { rows, columns, matrix, transposed }
    }

    /// M, row after row.
    #[cfg(feature = "gpu")]
    pub(crate) fn matrix(&self) -> &[f32] {
        &self.matrix
    }

    /// M X M^T.
    pub(crate) fn forward(&self, image: &[f32]) -> Vec<f32> {
        product(&product(&self.matrix, image, self.columns), &self.transposed, self.columns)
    }

    /// M^T Y M.
    pub(crate) fn adjoint(&self, image: &[f32]) -> Vec<f32> {
        product(&product(&self.transposed, image, self.rows), &self.matrix, self.rows)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_map_and_its_adjoint_are_what_their_matrix_says() {
        let map = Separable::new(vec![1.0, 2.0, 3.0, 0.0, -1.0, 5.0], 3);
        let wave = |row: usize, column: usize| {
            let mut image = [0.0; 9];
            image[row * 3 + column] = 1.0;
            image
        };
        // Column 1 of the matrix by its column 2.
        assert_eq!(map.forward(&wave(1, 2)), [6.0, 10.0, -3.0, -5.0]);
        // Row 0 of the matrix by its row 1.
        assert_eq!(map.adjoint(&[0.0, 1.0, 0.0, 0.0])[..6], [0.0, -1.0, 5.0, 0.0, -2.0, 10.0]);
    }
}
