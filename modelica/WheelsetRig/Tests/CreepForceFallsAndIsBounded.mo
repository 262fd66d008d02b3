within WheelsetRig.Tests;
model CreepForceFallsAndIsBounded "The creep force rises to a peak, falls, and stays within mu*Q"
  parameter Units.Force Q = 80000.0 "Wheel load";
  parameter Units.Velocity v = 40.0 "Rolling velocity";
  parameter Contact.PolachParameters polach;
  Units.Velocity w = 20.0*time "Slip velocity";
  Units.Force K = Contact.kalkerStiffness(Q);
  Units.Force F = Contact.creepForce(w, v, Q, K, 0.55, polach);
  Units.FrictionCoefficient mu = Contact.frictionCoefficient(w, 0.55, polach);
  Real rate(unit="N/s") "Change of the force per second";
equation
  rate = der(F);
  assert(F <= mu*Q, "The creep force exceeds friction");
  assert(time < 0.5 or F < 0.45*0.55*Q, "Friction does not fall to its share A = 0.4");
  // The peak for these values lies at 0.82 m/s, reached at 0.041 s; 5 % around it is left out.
  assert(time > 0.039 or rate > 0.0, "The creep force falls before its peak");
  // Beyond 10 m/s the friction has reached its lower bound.
  assert(time < 0.043 or time > 0.5 or rate < 0.0, "The creep force does not fall beyond its peak");
  annotation (experiment(StopTime=1.0));
end CreepForceFallsAndIsBounded;
