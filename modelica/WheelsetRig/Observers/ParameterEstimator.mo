within WheelsetRig.Observers;
model ParameterEstimator "Full model, its frictions set by a PI controller from measured speeds"
  extends PartialObserver(effect_muWR=42.4198268, effect_muDC=-105.223644);
  parameter Real L11(unit="s/rad") = 0.0 "From dy of the wheelset to muWR";
  parameter Real L12(unit="s/rad") = 0.0 "From dy of the roller to muWR";
  parameter Real L13(unit="1/rad") = 42.9677889 "From the integral of dy of the wheelset to muWR";
  parameter Real L14(unit="1/rad") = -65.3440139 "From the integral of dy of the roller to muWR";
  parameter Real L21(unit="s/rad") = 0.0 "From dy of the wheelset to muDC";
  parameter Real L22(unit="s/rad") = -1.98202191 "From dy of the roller to muDC";
  parameter Real L23(unit="1/rad") = 0.0 "From the integral of dy of the wheelset to muDC";
  parameter Real L24(unit="1/rad") = -21.2359491 "From the integral of dy of the roller to muDC";

  output Units.FrictionCoefficient muWR = frictionWR.acting
    "Friction wheel-rail at zero slip velocity, estimated";
  output Units.FrictionCoefficient muDC = frictionDC.acting "Friction disc-pad, estimated";

  FullObserver plant(
    pB=pB, tauR=tauR, dmuWR=muWR - plant.muWR, dmuDC=muDC - plant.muDC,
    correctionW=0.0, correctionR=0.0) "Observer model";

protected
  Units.FrictionCoefficient slowWR(start=plant.muWR, fixed=true, min=0.03, max=0.55)
    "Part of muWR that the integral of dy makes";
  Units.FrictionCoefficient slowDC(start=plant.muDC, fixed=true, min=0.10, max=0.45)
    "Part of muDC that the integral of dy makes";
  Applied frictionWR(
    value=slowWR + fade*authorityWR.held*(L11*dy[1] + L12*dy[2]), period=samplePeriod,
    acting(start=plant.muWR, min=0.03, max=0.55));
  Applied frictionDC(
    value=slowDC + fade*authorityDC.held*(L21*dy[1] + L22*dy[2]), period=samplePeriod,
    acting(start=plant.muDC, min=0.10, max=0.45));
  Units.Force Q "Wheel load, never zero or negative";
  Units.Force padForce "Friction force of one unit per unit of muDC";
  Units.Force FxByMu "Change of Fx per unit of muWR";
  Real FxByQ(unit="1") "Change of Fx with the wheel load";
  Units.Force QByPads "Change of the wheel load per unit of muDC, from the pads' lift";
equation
  omegaWEstimate = plant.omegaW;
  omegaREstimate = plant.omegaR;
  Fx = plant.Fx;
  slip = plant.slip;
  v = plant.rR*omegaR;
  Q = 0.5*(plant.Fz + sqrt(plant.Fz^2 + plant.QMin^2));
  padForce = plant.actuation.Fperp
    *tanh((plant.rB*plant.omegaW - plant.vF - plant.lB*plant.omegaBeta)/(plant.rB*plant.omega0));
  FxByMu = 2.0*creepForceByFriction(
    plant.slip, plant.rR*plant.omegaR, Q, Contact.kalkerStiffness(Q), plant.adhesion.mu0,
    plant.polach);
  // The stiffness grows with Q^(2/3), so Q*dFx/dQ = Fx - (Fx - mu0*dFx/dmu0)/3.
  FxByQ = (2.0*plant.Fx + plant.adhesion.mu0*FxByMu)/(3.0*Q);
  QByPads = 0.5*plant.nDiscs*padForce*Q/sqrt(plant.Fz^2 + plant.QMin^2);
  actualWR = plant.rW/plant.JW*FxByMu;
  actualDC = (plant.rW*FxByQ*QByPads - plant.nDiscs*plant.rB*padForce)/plant.JW;
  der(slowWR) = fade*authorityWR.held*(L13*dy[1] + L14*dy[2]);
  der(slowDC) = fade*authorityDC.held*(L23*dy[1] + L24*dy[2]);
  annotation (
    experiment(StopTime=40.0, Interval=0.005),
    Documentation(info="<html>
<p><code>[dmuWR; dmuDC] = L*[dy; integral of dy]</code>, with rows <code>muWR, muDC</code> and
columns <code>dy</code> (2), integral of <code>dy</code> (2). The integral is that of the gain times
<code>dy</code>, so that it can be kept within the limits of the friction.</p>
<p>The default gains place two poles of <code>muDC</code> at 15 rad/s and one of <code>muWR</code>
at 2 rad/s, at 22 m/s and 1.5 bar.</p>
<h4>References</h4>
<p>C. Schwarz, J. Brembeck, B. Heckmann (2018), equation (7).</p>
</html>"));
end ParameterEstimator;
