"""Parts of the stage diagnose, a folder a step, in the order in which they are used.

`base` fits the linear gyro to all runs; `drive` is what a log leaves open of what loops did to
them; `suspects` asks whether a run is what it says it is; `samples` is what the samples show before
any dynamics; `fits` scores a cause beside a fit and fits it; `search` chooses among causes and
describes what none of them holds; `extended` writes the model and simulates what it wrote;
`closing` checks the final result, which alone gives the word; `report` says it. `thresholds` has
every constant of the decision.
"""
