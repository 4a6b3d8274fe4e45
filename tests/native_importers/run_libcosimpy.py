"""Runs the default experiment with libcosimpy and prints the final value of a Real variable: FMU VALUE_REFERENCE."""

import sys

from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave

execution = CosimExecution.from_step_size(step_size=10_000_000)  # ns
slave = execution.add_local_slave(local_slave=CosimLocalSlave(fmu_path=sys.argv[1], instance_name="pendulum"))
observer = CosimObserver.create_last_value()
execution.add_observer(observer=observer)
assert execution.simulate_until(target_time=10_000_000_000)
values = observer.last_real_values(slave_index=slave, variable_references=[int(sys.argv[2])])
print("phi", values[0])
