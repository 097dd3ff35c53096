"""The pytest plugin: step responses, limits on metrics, golden metrics, cases of the study, reports
of failures.

pytest loads it by itself. The fixture `step_response` runs a law from rest to a step, and returns a
`smc_mujoco.testing.response.StepResponse`, whose attributes are the metrics of `smc.score`:

    def test_my_law_settles(step_response):
        r = step_response("inverted_pendulum", my_law, step=0.2, friction=smc.Coulomb(0.05))
        assert r.settling_time < 0.6 and r.overshoot < 5 and r.tv_rate < 10
        r.check(ultimate_bound=0.02, max_u=6.0)

`step` is in rad or m; `condition="noise"` and the other arguments are as in `smc.Scenario`. With a
mark a test runs in each case, which its arguments `plant` and `condition` name:

    @pytest.mark.smc(plants=["duffing"], conditions=["nominal", "noise"])
    def test_my_law_settles_in_each_case(step_response, plant, condition):
        assert step_response(plant, my_law, step=0.2, condition=condition).settling_time < 1.0
"""
