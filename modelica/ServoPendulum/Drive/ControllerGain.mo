within ServoPendulum.Drive;
model ControllerGain "A controller whose gain is not what its manual says"
  extends Common.Signals.Gain(gain(min=-0.6, max=1.5));
  annotation (
    __Workbench(effect(
      size="gain", matters=0.02, slots={"gain"},
      separation="the duty that the servo reports, over the position error")),
    Documentation(info="<html>
<p>Units of such gains are often not documented, or differ between firmwares.</p>
</html>"));
end ControllerGain;
