within WheelsetRig.Tests;
model CreepForceIsOdd "The creep force changes sign with slip and is even in speed"
  parameter Units.Force Q = 80000.0 "Wheel load";
  parameter Contact.PolachParameters polach;
  Units.Velocity w = 10.0*time - 5.0 "Slip velocity";
  Units.Velocity v = 40.0*time - 20.0 "Rolling velocity";
  Units.Force K = Contact.kalkerStiffness(Q);
  Units.Force F = Contact.creepForce(w, v, Q, K, 0.4, polach);
equation
  // Rounding of 10 kN in double precision is 1e-12 N.
  assert(abs(F + Contact.creepForce(-w, v, Q, K, 0.4, polach)) < 1e-9, "Not odd in slip");
  assert(abs(F - Contact.creepForce(w, -v, Q, K, 0.4, polach)) < 1e-9, "Not even in speed");
  annotation (experiment(StopTime=1.0));
end CreepForceIsOdd;
