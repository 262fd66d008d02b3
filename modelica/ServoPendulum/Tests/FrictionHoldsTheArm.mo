within ServoPendulum.Tests;
model FrictionHoldsTheArm "Dry friction above the torque of the weight holds the arm, below it lets go"
  Servo held(goal=0.0, volts=7.4, enabled=0.0, dtauF=0.0, position(start=0.2),
    redeclare Friction.DryFriction friction(coulomb=0.12));
  Servo released(goal=0.0, volts=7.4, enabled=0.0, dtauF=0.0, position(start=0.2),
    redeclare Friction.DryFriction friction(coulomb=0.09));
equation
  // 0.1047 N.m of the weight: a creep of 1e-4*atanh(0.87) = 1.3e-4 rad/s, less than a step of the
  // encoder (1.5e-3 rad) in five seconds.
  assert(abs(held.position - 0.2) < 1e-3, "The arm does not hold");
  assert(time < 1.0 or released.position < 0.19, "The arm holds against a greater torque");
  annotation (experiment(StopTime=5.0, Tolerance=1e-7));
end FrictionHoldsTheArm;
