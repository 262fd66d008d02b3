within TrainRig;
model Reference "Two coupled vehicles, with the signals of a recording"
  extends CoupledTrain(final vehicles=2, between={2.5, 16.5, 2.5, 4.9, 2.5, 16.5, 2.5});
  input Real pB1(unit="Pa") "Pressure of bogie 1";
  input Real pB2(unit="Pa") "Pressure of bogie 2";
  input Real pB3(unit="Pa") "Pressure of bogie 3";
  input Real pB4(unit="Pa") "Pressure of bogie 4";
  input Real mass1(unit="kg", start=48000.0) "Mass of vehicle 1";
  input Real mass2(unit="kg", start=48000.0) "Mass of vehicle 2";
  input Real slope1(unit="1") "Gradient under the middle of vehicle 1";
  input Real slope2(unit="1") "Gradient under the middle of vehicle 2";
  input Real curve(unit="1") "Resistance of curves over weight";
  output Real omega1(unit="rad/s") = axle[1].omega "Of axle 1";
  output Real omega2(unit="rad/s") = axle[2].omega "Of axle 2";
  output Real omega3(unit="rad/s") = axle[3].omega "Of axle 3";
  output Real omega4(unit="rad/s") = axle[4].omega "Of axle 4";
  output Real omega5(unit="rad/s") = axle[5].omega "Of axle 5";
  output Real omega6(unit="rad/s") = axle[6].omega "Of axle 6";
  output Real omega7(unit="rad/s") = axle[7].omega "Of axle 7";
  output Real omega8(unit="rad/s") = axle[8].omega "Of axle 8";
  output Real a(unit="m/s2", start=0.0, fixed=true, nominal=1.0) "Of the accelerometer";
  output Real vTrain(unit="m/s") = vehicle[1].v "Speed of the first vehicle";
  output Real force(unit="N") = sum(axle[i].Fx for i in 1:n) "Braking force of all axles";
  output Real slip(unit="m/s") = axle[1].w "Slip velocity of axle 1";
  output Real tension(unit="N") = coupler[1].F "Tension of the coupler";
equation
  p = {pB1, pB2, pB3, pB4};
  m = {mass1, mass2};
  slope = {slope1, slope2};
  curves = curve;
  // A filter of first order at 5 Hz.
  der(a) = 6.283185307179586*5.0*(vehicle[1].acceleration + g*slope1 - a);
  annotation (experiment(StopTime=60.0, Tolerance=1e-6));
end Reference;
