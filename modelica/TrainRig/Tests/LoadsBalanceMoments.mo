within TrainRig.Tests;
model LoadsBalanceMoments "Wheel loads carry the weight and hold body and bogies against tilting"
  Parts.Vehicle vehicle(m=50e3, Fx={14e3, 12e3, 13e3, 9e3}, resistance=2e3, v(start=30.0));
protected
  Real Q[4](each unit="N") = vehicle.Q;
equation
  assert(abs(vehicle.acceleration + 1.0) < 1e-12, "50 kN do not slow 50 t down");
  assert(abs(2.0*sum(Q) - 50e3*9.81) < 1e-6, "Loads do not carry the weight");
  // After ten time constants: 50 kN of inertia, 1.3 m above the pivots of bogies that are 19 m apart.
  assert(time < 1.6 or abs(19.0*(Q[1] + Q[2] - Q[3] - Q[4]) - 1.3*50e3) < 1e-4*1.3*50e3,
    "The body tilts");
  // The forces of both axles, 0.5 m below the pivot, 2.5 m apart.
  assert(time < 1.6 or abs(2.0*2.5*0.5*(Q[1] - Q[2]) - 0.5*26e3) < 1.0
    and abs(2.0*2.5*0.5*(Q[3] - Q[4]) - 0.5*22e3) < 1.0, "A bogie tilts");
  annotation (experiment(StopTime=2.0, Tolerance=1e-7));
end LoadsBalanceMoments;
