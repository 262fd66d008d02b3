within ServoPendulum.Drive;
model CurrentLimit "A current that is limited"
  extends Common.Signals.Saturation(width=0.05, high(unit="A", min=0.2, max=5.0), share(max=1.0));
  annotation (
    __Workbench(effect(
      size="share", matters=0.1, shapes(high={1.0, 1.5}), slots={"current"},
      hidden="in position mode such servos do not limit their current",
      separation="the torque with the shaft blocked, over the duty")),
    Documentation(info="<html>
<p>Such servos limit their current in the modes that control it, to 1.75 A when they leave the works;
in position mode, which is the one of this system, they do not.</p>
<h4>References</h4>
<p>Robotis, <em>XL330-M288 e-Manual</em>, Current Limit(38).</p>
</html>"));
end CurrentLimit;
