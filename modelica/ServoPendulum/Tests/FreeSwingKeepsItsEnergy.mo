within ServoPendulum.Tests;
model FreeSwingKeepsItsEnergy "Without current and friction the arm swings for ever; friction takes work"
  Servo free(goal=1.0, volts=7.4, enabled=0.0, dtauF=0.0, position(start=0.5));
  Servo viscous(goal=1.0, volts=7.4, enabled=0.0, dtauF=0.0, position(start=0.5),
    redeclare Friction.ViscousFriction friction(damping=2e-3));
  Real lost(unit="J", start=0.0, fixed=true) "Work of the viscous friction";
protected
  parameter Real E0 = -0.4805259*cos(0.52);
equation
  der(lost) = 2e-3*viscous.speed^2;
  assert(abs(0.5*0.0069*free.speed^2 - 0.4805259*cos(free.position + 0.02) - E0) < 1e-6,
    "Energy is not conserved");
  assert(abs(0.5*0.0069*viscous.speed^2 - 0.4805259*cos(viscous.position + 0.02) + lost - E0) < 1e-6,
    "Friction does not take what is lost");
  annotation (experiment(StopTime=5.0, Tolerance=1e-9));
end FreeSwingKeepsItsEnergy;
