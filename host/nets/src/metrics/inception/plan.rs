//! The architecture: the layers of Inception-v3, in order, under torchvision's names. Every kernel
//! size and number of channels is stated here only.

/// One layer, without weights.
#[derive(Debug, Clone, PartialEq)]
pub enum Plan {
    /// A convolution, batch normalisation, ReLU.
    Convolution {
        name: &'static str,
        outputs: usize,
        kernel: [usize; 2],
        stride: usize,
        padding: [usize; 2],
    },
    /// Mean of 3 x 3, stride 1, without the padding.
    Mean,
    /// Maximum of 3 x 3.
    Maximum { stride: usize, padding: usize },
    /// Branches with one input. Names inside begin with this name.
    Branches { name: &'static str, branches: Vec<Vec<Plan>> },
}

/// All layers before the last pooling: (3, 299, 299) to (2048, 8, 8).
pub fn network() -> Vec<Plan> {
    let pool = || Plan::Maximum { stride: 2, padding: 0 };
    vec![
        halving("Conv2d_1a_3x3", 32),
        inside("Conv2d_2a_3x3", 32),
        conv("Conv2d_2b_3x3", 64, [3, 3]),
        pool(),
        conv("Conv2d_3b_1x1", 80, [1, 1]),
        inside("Conv2d_4a_3x3", 192),
        pool(),
        figure_5("Mixed_5b.", 32),
        figure_5("Mixed_5c.", 64),
        figure_5("Mixed_5d.", 64),
        reduction_6(),
        figure_6("Mixed_6b.", 128),
        figure_6("Mixed_6c.", 160),
        figure_6("Mixed_6d.", 160),
        figure_6("Mixed_6e.", 192),
        reduction_7(),
        figure_7("Mixed_7b.", Plan::Mean),
        // This pooling is an error in the published graph; FID's definition keeps it.
        figure_7("Mixed_7c.", Plan::Maximum { stride: 1, padding: 1 }),
    ]
}

/// A convolution that keeps the size.
fn conv(name: &'static str, outputs: usize, kernel: [usize; 2]) -> Plan {
    Plan::Convolution { name, outputs, kernel, stride: 1, padding: kernel.map(|edge| edge / 2) }
}

/// A convolution of 3 x 3 without padding.
fn inside(name: &'static str, outputs: usize) -> Plan {
    Plan::Convolution { name, outputs, kernel: [3, 3], stride: 1, padding: [0, 0] }
}

/// A convolution of 3 x 3 without padding, with stride 2.
fn halving(name: &'static str, outputs: usize) -> Plan {
    Plan::Convolution { name, outputs, kernel: [3, 3], stride: 2, padding: [0, 0] }
}

/// Two small kernels instead of a large one (the paper's figure 5).
fn figure_5(name: &'static str, pooled: usize) -> Plan {
    let branches = vec![
        vec![conv("branch1x1", 64, [1, 1])],
        vec![conv("branch5x5_1", 48, [1, 1]), conv("branch5x5_2", 64, [5, 5])],
        vec![
            conv("branch3x3dbl_1", 64, [1, 1]),
            conv("branch3x3dbl_2", 96, [3, 3]),
            conv("branch3x3dbl_3", 96, [3, 3]),
        ],
        vec![Plan::Mean, conv("branch_pool", pooled, [1, 1])],
    ];
    Plan::Branches { name, branches }
}

fn reduction_6() -> Plan {
    let branches = vec![
        vec![halving("branch3x3", 384)],
        vec![
            conv("branch3x3dbl_1", 64, [1, 1]),
            conv("branch3x3dbl_2", 96, [3, 3]),
            halving("branch3x3dbl_3", 96),
        ],
        vec![Plan::Maximum { stride: 2, padding: 0 }],
    ];
    Plan::Branches { name: "Mixed_6a.", branches }
}

/// Kernels of one row or one column (the paper's figure 6).
fn figure_6(name: &'static str, narrow: usize) -> Plan {
    let branches = vec![
        vec![conv("branch1x1", 192, [1, 1])],
        vec![
            conv("branch7x7_1", narrow, [1, 1]),
            conv("branch7x7_2", narrow, [1, 7]),
            conv("branch7x7_3", 192, [7, 1]),
        ],
        vec![
            conv("branch7x7dbl_1", narrow, [1, 1]),
            conv("branch7x7dbl_2", narrow, [7, 1]),
            conv("branch7x7dbl_3", narrow, [1, 7]),
            conv("branch7x7dbl_4", narrow, [7, 1]),
            conv("branch7x7dbl_5", 192, [1, 7]),
        ],
        vec![Plan::Mean, conv("branch_pool", 192, [1, 1])],
    ];
    Plan::Branches { name, branches }
}

fn reduction_7() -> Plan {
    let branches = vec![
        vec![conv("branch3x3_1", 192, [1, 1]), halving("branch3x3_2", 320)],
        vec![
            conv("branch7x7x3_1", 192, [1, 1]),
            conv("branch7x7x3_2", 192, [1, 7]),
            conv("branch7x7x3_3", 192, [7, 1]),
            halving("branch7x7x3_4", 192),
        ],
        vec![Plan::Maximum { stride: 2, padding: 0 }],
    ];
    Plan::Branches { name: "Mixed_7a.", branches }
}

/// Row and column kernels side by side (the paper's figure 7).
fn figure_7(name: &'static str, pool: Plan) -> Plan {
    let beside = |across: &'static str, down: &'static str| Plan::Branches {
        name: "",
        branches: vec![vec![conv(across, 384, [1, 3])], vec![conv(down, 384, [3, 1])]],
    };
    let branches = vec![
        vec![conv("branch1x1", 320, [1, 1])],
        vec![conv("branch3x3_1", 384, [1, 1]), beside("branch3x3_2a", "branch3x3_2b")],
        vec![
            conv("branch3x3dbl_1", 448, [1, 1]),
            conv("branch3x3dbl_2", 384, [3, 3]),
            beside("branch3x3dbl_3a", "branch3x3dbl_3b"),
        ],
        vec![pool, conv("branch_pool", 192, [1, 1])],
    ];
    Plan::Branches { name, branches }
}
