"""Trains the networks of nirspi on your own characters: ``python -m nirspi.train NETWORK --out RUN``.

Needs PyTorch (``pip install torch``), which nothing else in nirspi does. ``docs/training.md`` is the manual.

| module | contents |
|---|---|
| `data` | stacks of characters, the groups held out from training, pairs from the virtual camera |
| `optics` | the camera as formulas |
| `scenes` | examples: scenes, degraded |
| `networks` | the networks |
| `tasks` | the loss and the held-out score of each network |
| `run` | one run: learning rate, running average, log, checkpoints, early end |
| `folder` | a run's files |
"""
