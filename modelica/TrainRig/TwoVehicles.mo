within TrainRig;
model TwoVehicles "Two vehicles with four axles each"
  extends Train(final vehicles=2);
  parameter Real zero[bogies](each unit="Pa", each min=-1e5, each max=1e5) = zeros(bogies)
    "Readings of the pressure sensors of empty cylinders";
  parameter Real pressureAsked(unit="Pa", min=0.0) = 2.7e5 "Pressure that the brake asks of a full vehicle";
  parameter Real massFull(unit="kg", min=1.0) = 56000.0 "Mass of a full vehicle";
  parameter Real regulation[bogies](each unit="1", each min=0.5, each max=2.0) = fill(1.0, bogies)
    "Pressure of a bogie, of the one that its load asks for";
  input Real pB1(unit="Pa") "Pressure of bogie 1";
  input Real pB2(unit="Pa") "Pressure of bogie 2";
  input Real pB3(unit="Pa") "Pressure of bogie 3";
  input Real pB4(unit="Pa") "Pressure of bogie 4";
  input Real mass1(unit="kg", start=48000.0) "Weighed mass of vehicle 1";
  input Real mass2(unit="kg", start=48000.0) "Weighed mass of vehicle 2";
  input Real slope1(unit="1") "Gradient under the middle of vehicle 1";
  input Real slope2(unit="1") "Gradient under the middle of vehicle 2";
  input Real curve(unit="1") "Resistance of curves over weight";
  input Real dmuDC1(unit="1") "Correction of muDC[1]";
  input Real dmuDC2(unit="1") "Correction of muDC[2]";
  input Real dmuDC3(unit="1") "Correction of muDC[3]";
  input Real dmuDC4(unit="1") "Correction of muDC[4]";
  input Real dmuDC5(unit="1") "Correction of muDC[5]";
  input Real dmuDC6(unit="1") "Correction of muDC[6]";
  input Real dmuDC7(unit="1") "Correction of muDC[7]";
  input Real dmuDC8(unit="1") "Correction of muDC[8]";
  input Real dr1(unit="m") "Correction of r[1]";
  input Real dr2(unit="m") "Correction of r[2]";
  input Real dr3(unit="m") "Correction of r[3]";
  input Real dr4(unit="m") "Correction of r[4]";
  input Real dr5(unit="m") "Correction of r[5]";
  input Real dr6(unit="m") "Correction of r[6]";
  input Real dr7(unit="m") "Correction of r[7]";
  input Real dr8(unit="m") "Correction of r[8]";
  input Real dmass1(unit="1") "Correction of mass[1]";
  input Real dmass2(unit="1") "Correction of mass[2]";
  input Real dmuWR(unit="1") "Correction of muWR";
  input Real dA(unit="N") "Correction of A";
  input Real dC(unit="N.s2/m2") "Correction of C";
  input Real dgradient(unit="1") "Correction of gradientError";
  input Real dbias(unit="m/s2") "Correction of bias";
  output Real omega1(unit="rad/s", start=0.0, fixed=true, nominal=50.0) "Of axle 1";
  output Real omega2(unit="rad/s", start=0.0, fixed=true, nominal=50.0) "Of axle 2";
  output Real omega3(unit="rad/s", start=0.0, fixed=true, nominal=50.0) "Of axle 3";
  output Real omega4(unit="rad/s", start=0.0, fixed=true, nominal=50.0) "Of axle 4";
  output Real omega5(unit="rad/s", start=0.0, fixed=true, nominal=50.0) "Of axle 5";
  output Real omega6(unit="rad/s", start=0.0, fixed=true, nominal=50.0) "Of axle 6";
  output Real omega7(unit="rad/s", start=0.0, fixed=true, nominal=50.0) "Of axle 7";
  output Real omega8(unit="rad/s", start=0.0, fixed=true, nominal=50.0) "Of axle 8";
  output Real omegaReading[8](each unit="rad/s") = speedSensor.y "Readings of the speed sensors";
  output Real pBRest[bogies](each unit="Pa") = cylinder.rest "Readings of empty cylinders";
  output Real pBHeld[bogies](each unit="Pa") = cylinder.held "Readings while the brake is applied";
  output Real slip(unit="m/s") = v - rA[1]*omega1 "Slip velocity of axle 1";
  output Real vGNSS(unit="m/s") = v "Speed that satellites tell";
  output Real force(unit="N") = sum(Fx) "Braking force of all axles";
  output Real a(unit="m/s2", start=0.0, fixed=true, nominal=1.0) "Of the accelerometer";
  output Real vTrain(unit="m/s", start=0.0, fixed=true, nominal=20.0) "Speed of the train";

  replaceable Slots.UnchangedBogies cylinder(u={pB1, pB2, pB3, pB4} - zero, restBefore=zero,
      heldBefore=asked)
    constrainedby Slots.PartialBogies(
      u={pB1, pB2, pB3, pB4} - zero, restBefore=zero, heldBefore=asked)
    "From the reading of a bogie's sensor to its cylinders";
  replaceable Slots.UnchangedPads padFriction(u=ordinary, T=T, power=frictionPower)
    constrainedby Slots.PartialPads(u=ordinary, T=T, power=frictionPower) "Pads";
  replaceable Slots.UnchangedAxles brakeUnits(u=fill(units, n))
    constrainedby Slots.PartialAxles(u=fill(units, n)) "Brake units that act";
  replaceable Slots.FreeAxles dragging(omega=omega)
    constrainedby Slots.PartialDrag(omega=omega) "What else brakes an axle";
  replaceable Slots.UnchangedAxles radius(u=r)
    constrainedby Slots.PartialAxles(u=r) "Wheel radius";
  replaceable Slots.UnchangedVehicles weighed(
      u={(mass[1] + dmass1)*mass1, (mass[2] + dmass2)*mass2})
    constrainedby Slots.PartialVehicles(
      u={(mass[1] + dmass1)*mass1, (mass[2] + dmass2)*mass2}) "Mass of the vehicles";
  replaceable Common.Signals.Unchanged adhesion(u=muWR)
    constrainedby Common.Interfaces.Signal(u=muWR) "Friction wheel-rail";
  replaceable Common.Signals.Unchanged gradient(u=(mass1*slope1 + mass2*slope2)/(mass1 + mass2))
    constrainedby Common.Interfaces.Signal(u=(mass1*slope1 + mass2*slope2)/(mass1 + mass2)) "Mean gradient under the train";
  replaceable Common.Signals.Unchanged airResistance(u=C)
    constrainedby Common.Interfaces.Signal(u=C) "Resistance of the air";
  replaceable Slots.UnchangedAxles speedSensor(u=omega)
    constrainedby Slots.PartialAxles(u=omega) "Speed sensors";
  replaceable Common.Signals.Unchanged accelerometer(u=felt)
    constrainedby Common.Interfaces.Signal(u=felt) "Accelerometer";
protected
  Real asked[bogies](each unit="Pa") "Readings of right sensors while the brake is applied";
equation
  for j in 1:2 loop
    asked[j] = zero[j] + regulation[j]*(pRelease + (pressureAsked - pRelease)*mass1/massFull);
    asked[j + 2] = zero[j + 2] + regulation[j + 2]*(pRelease + (pressureAsked - pRelease)*mass2/massFull);
  end for;
  // Of the pads alone, in place of forces that follow from loads themselves.
  braking = sum(tauB[i]/rA[i] for i in 1:n)/weight;
  pC = cylinder.y;
  mu = padFriction.y;
  acting = brakeUnits.y;
  drag = dragging.tau;
  rA = radius.y + {dr1, dr2, dr3, dr4, dr5, dr6, dr7, dr8};
  m = weighed.y;
  mu0 = adhesion.y + dmuWR;
  rest = A + dA;
  air = airResistance.y + dC;
  uphill = gradient.y + gradientError + dgradient;
  slope = {slope1, slope2} + fill(gradientError + dgradient, vehicles);
  curves = curve;
  dmuDC = {dmuDC1, dmuDC2, dmuDC3, dmuDC4, dmuDC5, dmuDC6, dmuDC7, dmuDC8};
  omega = {omega1, omega2, omega3, omega4, omega5, omega6, omega7, omega8};
  v = vTrain;
  der(omega1) = rate[1];
  der(omega2) = rate[2];
  der(omega3) = rate[3];
  der(omega4) = rate[4];
  der(omega5) = rate[5];
  der(omega6) = rate[6];
  der(omega7) = rate[7];
  der(omega8) = rate[8];
  der(vTrain) = acceleration;
  // A filter of first order at 5 Hz.
  der(a) = 6.283185307179586*5.0*(accelerometer.y + dbias - a);
  annotation (
    experiment(StopTime=60.0, Tolerance=1e-6),
    Documentation(info="<html>
<p><code>Train</code> with the signals of a recording: each has a name of its own, by its number. Wheel loads
shift at once, with the deceleration that pads ask for.</p>
</html>"));
end TwoVehicles;
