"""Each estimator of the registry passes the suite that is offered for those of others."""

import pytest

from adhesion_can.estimation.registry import ESTIMATORS, EstimatorSettings
from adhesion_can.testing import EstimatorSuite


class TestEach(EstimatorSuite):
    @pytest.fixture(autouse=True, params=ESTIMATORS)
    def choose(self, request):
        self.make = lambda: ESTIMATORS[request.param](EstimatorSettings())
