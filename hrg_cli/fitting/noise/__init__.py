"""The noise that fits reckon with, a model of it each file.

`window_scatter`: the white level of windows of few samples. `channel_noise`: two channels of
unequal level, whitened. `colour`: a wander beside white noise, component by component.
`noise_propagation`: what integrals make of rows' noise. `increment_noise`: white angles and a walk
of their increments. What scatters along known directions is whitened by `causes.designs.Softened`,
nuisances are projected out by `causes.designs.Basis`; by how much residuals exceed the stated noise
tells `envelopes.inference.estimate_variance_inflation`.
"""
