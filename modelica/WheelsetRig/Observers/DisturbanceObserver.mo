within WheelsetRig.Observers;
model DisturbanceObserver "Minimal model, its frictions states that are corrected by measured speeds"
  extends PartialObserver(effect_muWR=49.3865394, effect_muDC=-111.068182);
  parameter Real L11(unit="1/s") = 4.14191574 "From dy of the wheelset to der(omegaW)";
  parameter Real L12(unit="1/s") = 141.40357 "From dy of the roller to der(omegaW)";
  parameter Real L13(unit="1/s2") = 0.0 "From the integral of dy of the wheelset to der(omegaW)";
  parameter Real L14(unit="1/s2") = 0.0 "From the integral of dy of the roller to der(omegaW)";
  parameter Real L21(unit="1/s") = 1.4140357 "From dy of the wheelset to der(omegaR)";
  parameter Real L22(unit="1/s") = 79.6138558 "From dy of the roller to der(omegaR)";
  parameter Real L23(unit="1/s2") = 0.0 "From the integral of dy of the wheelset to der(omegaR)";
  parameter Real L24(unit="1/s2") = 0.0 "From the integral of dy of the roller to der(omegaR)";
  parameter Real L31(unit="1/rad") = 22.5905208 "From dy of the wheelset to der(muWR)";
  parameter Real L32(unit="1/rad") = -54.413711 "From dy of the roller to der(muWR)";
  parameter Real L33(unit="1/(rad.s)") = 0.0 "From the integral of dy of the wheelset to der(muWR)";
  parameter Real L34(unit="1/(rad.s)") = 0.0 "From the integral of dy of the roller to der(muWR)";
  parameter Real L41(unit="1/rad") = -5.51710137 "From dy of the wheelset to der(muDC)";
  parameter Real L42(unit="1/rad") = -228.993134 "From dy of the roller to der(muDC)";
  parameter Real L43(unit="1/(rad.s)") = 0.0 "From the integral of dy of the wheelset to der(muDC)";
  parameter Real L44(unit="1/(rad.s)") = 0.0 "From the integral of dy of the roller to der(muDC)";
  parameter Real T_muWR(unit="1/s", max=0.0) = -0.02 "Rate at which muWR returns to nominal";
  parameter Real T_muDC(unit="1/s", max=0.0) = -0.02 "Rate at which muDC returns to nominal";

  output Units.FrictionCoefficient muWR(start=plant.muWR, fixed=true, min=0.03, max=0.55)
    "Friction wheel-rail at zero slip velocity, estimated";
  output Units.FrictionCoefficient muDC(start=plant.muDC, fixed=true, min=0.10, max=0.45)
    "Friction disc-pad, estimated";

  MinimalObserver plant(
    pB=pB, tauR=tauR, dmuWR=muWR - plant.muWR, dmuDC=muDC - plant.muDC,
    correctionW=fade*correction[1], correctionR=fade*correction[2]) "Observer model";

protected
  Units.Angle integral[2](each start=0.0, each fixed=true) "Integral of dy";
  Units.AngularAcceleration correction[2] "Of the speeds: L [dy; integral of dy], rows 1 and 2";
  Real drift[2](each unit="1/s") "Of the frictions: L [dy; integral of dy], rows 3 and 4";
equation
  omegaWEstimate = plant.omegaW;
  omegaREstimate = plant.omegaR;
  Fx = plant.Fx;
  slip = plant.slip;
  v = plant.rollerRadius.y*omegaR;
  actualWR = 2.0*plant.wheelRadius.y/plant.wheelInertia.y*creepForceByFriction(
    plant.slip, plant.rollerRadius.y*plant.omegaR, plant.wheelLoad.y, plant.creepStiffness.y,
    plant.adhesion.mu0, plant.polach);
  actualDC = -plant.nDiscs*plant.actuation.Fperp*plant.rB*tanh(plant.omegaW/plant.omega0)
    /plant.wheelInertia.y;
  der(integral) = dy;
  correction[1] = L11*dy[1] + L12*dy[2] + L13*integral[1] + L14*integral[2];
  correction[2] = L21*dy[1] + L22*dy[2] + L23*integral[1] + L24*integral[2];
  drift[1] = L31*dy[1] + L32*dy[2] + L33*integral[1] + L34*integral[2];
  drift[2] = L41*dy[1] + L42*dy[2] + L43*integral[1] + L44*integral[2];
  der(muWR) = T_muWR*(muWR - plant.muWR) + fade*authorityWR.held*drift[1];
  der(muDC) = T_muDC*(muDC - plant.muDC) + fade*authorityDC.held*drift[2];
  annotation (
    experiment(StopTime=40.0, Interval=0.005),
    Documentation(info="<html>
<p><code>der([omega; mu]) = f + L*[dy; integral of dy]</code>, with rows <code>omegaW, omegaR, muWR,
muDC</code> and columns <code>dy</code> (2), integral of <code>dy</code> (2); <code>f</code> is the
observer model for the speeds, and for the frictions the return to nominal with rates
<code>T_muWR</code>, <code>T_muDC</code>.</p>
<p>The default gains are those of the stationary Kalman filter of the model linearised at 22 m/s
and 1.5 bar.</p>
<h4>References</h4>
<p>C. Schwarz, J. Brembeck, B. Heckmann (2018), equations (8) to (10).</p>
</html>"));
end DisturbanceObserver;
