within TrainRig.Tests;
model CoupledVehiclesSwing "Two equal vehicles swing at sqrt(2*c/m), and as a damped oscillator with a damper"
  model Pair "Two vehicles of 50 t that roll, their coupler drawn out by 20 mm"
    parameter Real d(unit="N.s/m") "Damping";
    Parts.Vehicle first(m=50e3, Fx=zeros(4), resistance=0.0, v(start=10.0));
    Parts.Vehicle second(m=50e3, Fx=zeros(4), resistance=0.0, v(start=10.0));
    Parts.Coupler coupler(c=1e7, d=d, s(start=0.02));
  equation
    connect(first.rear, coupler.front);
    connect(coupler.rear, second.front);
  end Pair;
  Pair free(d=0.0);
  Pair damped(d=1e5);
protected
  parameter Real rate(unit="rad/s") = sqrt(2.0*1e7/50e3) "20 rad/s";
  parameter Real decay(unit="1/s") = 1e5/50e3 "2 per second";
  parameter Real slower(unit="rad/s") = sqrt(rate^2 - decay^2);
equation
  // A solver errs by its tolerance of 10 mm, the nominal elongation, in each of some thousand steps.
  assert(abs(free.coupler.s - 0.02*cos(rate*time)) < 1e-6, "They do not swing at sqrt(2*c/m)");
  assert(abs(damped.coupler.s - 0.02*exp(-decay*time)*(cos(slower*time)
    + decay/slower*sin(slower*time))) < 1e-6, "The damper does not damp");
  assert(abs(0.5*(damped.first.v + damped.second.v) - 10.0) < 1e-6, "A coupler moves the train");
  annotation (experiment(StopTime=3.0, Tolerance=1e-9));
end CoupledVehiclesSwing;
